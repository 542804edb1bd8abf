"""The problem classes, and how each places its obstacles."""
