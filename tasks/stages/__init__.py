"""The stages of a run, one or two closely related ones in a file."""
