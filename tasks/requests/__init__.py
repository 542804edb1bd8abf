"""Requests about a user's own problems, maps and runs, one at a time."""
