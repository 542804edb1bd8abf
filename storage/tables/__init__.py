"""Parquet tables: one door to each."""
