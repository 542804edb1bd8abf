"""What a stage is, and how its chunks are given to Dask workers."""
