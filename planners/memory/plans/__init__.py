"""Stored plans: their sweeps, their cells, and whether they fit a problem."""
