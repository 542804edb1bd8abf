"""Collision, occupancy grids, and polygons into convex pieces."""
