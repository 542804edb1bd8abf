"""The encoder: its network, its training, and its fast forward pass."""
