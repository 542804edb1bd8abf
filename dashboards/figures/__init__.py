"""Rows and problems in, Matplotlib figures out."""
