"""What is made once for all tests: compiled kernels, and an empty database of Prefect's server."""
