"""Files that users provide and receive: problems, plans, exports for other tools."""
