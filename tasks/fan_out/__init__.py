"""Stages, their chunks and keys, sent to Dask workers, with progress."""
