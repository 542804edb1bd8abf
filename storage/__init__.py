"""Where data is stored: the only code that reads and writes files."""
