"""The memory: experiences, hallucinated problems, the encoder and recall."""
