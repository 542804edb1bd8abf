"""Retraining: what is new, who is champion, when to retrain."""
