"""The settings of a run, and checks of command-line values."""
