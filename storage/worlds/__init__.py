"""Worlds and maps in the formats that others write: one file a format."""
