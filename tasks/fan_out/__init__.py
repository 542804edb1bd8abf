"""Stages, and how their chunks are given to Dask workers."""
