"""The settings of a run, and checks of what commands are given."""
