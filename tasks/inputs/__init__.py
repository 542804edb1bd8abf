"""Where problems and experiences of a stage come from."""
