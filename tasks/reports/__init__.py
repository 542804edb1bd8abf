"""Reports about a run once its rows exist."""
