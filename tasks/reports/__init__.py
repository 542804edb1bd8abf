"""What is told of a run once its rows are there."""
