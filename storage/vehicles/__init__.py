"""Vehicles as people describe them: one file each, and what other files record of them."""
