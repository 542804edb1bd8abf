"""Where the problems and experiences of a stage come from."""
