"""What is served to other people: a memory, the dashboard, Prefect and MLflow for a team."""
