"""What runs record in MLflow and in Prefect's artifacts."""
