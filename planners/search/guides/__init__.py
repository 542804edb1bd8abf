"""Paths that guide a search, and how planners sample along them."""
