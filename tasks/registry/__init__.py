"""Memories in MLflow's registry: addresses, versions, champions."""
