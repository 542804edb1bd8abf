"""What runs leave in MLflow and among Prefect's artifacts."""
