"""Retraining: what is new, which memory is champion, when to retrain."""
