"""Ways to follow, and how a planner samples along them."""
