"""Planners from scratch: each is a plain function `(query, settings) -> Outcome`."""
