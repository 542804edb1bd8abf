"""What a run is asked to do, checked once; and what may not be shown."""
