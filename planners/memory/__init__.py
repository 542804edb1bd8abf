"""What is remembered: experiences, hallucinated problems, the encoder and recall."""
