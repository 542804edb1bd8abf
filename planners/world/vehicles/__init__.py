"""What each vehicle does: one file a kind, the functions that all of them have in ``interface``."""
