"""Attempts at problems: all timed the same way, judged, written as rows."""
