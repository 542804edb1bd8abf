"""Worlds and maps in formats written by other software, one file per format."""
