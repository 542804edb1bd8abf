"""Vehicle files, and what other files record about a vehicle."""
