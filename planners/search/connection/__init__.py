"""From a state to a goal pose without looking at obstacles: words of turns, driven within all limits."""
