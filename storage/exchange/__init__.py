"""Files that people hand in and take away: problems, plans, exports for other tools."""
