"""Work on a user's own problems, maps and runs, one request at a time."""
