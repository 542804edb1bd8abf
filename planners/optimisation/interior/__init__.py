"""Time-optimal drives by an interior-point method that moves all states and controls at once."""
