"""What planners build while they search: trees, roadmaps, nearest neighbours, controls."""
