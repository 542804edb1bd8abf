"""Trajectory optimisation: a guess becomes a shorter or clearer plan, or a blocked one a free one."""
