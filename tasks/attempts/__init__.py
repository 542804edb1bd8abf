"""Attempts at problems: timed alike, judged, written as rows."""
