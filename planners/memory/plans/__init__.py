"""Stored plans: their sweeps, their cells, and whether they are free in a problem."""
