"""Where things lie: the only code that touches bytes."""
