"""Folders of arrays and weights with checksums: encoders, memories, checkpoints."""
