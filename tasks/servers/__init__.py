"""Servers that commands start: who may reach them, and how they start and stop."""
