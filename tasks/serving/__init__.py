"""What is served to others: a memory, the dashboard, Prefect and MLflow for a team."""
