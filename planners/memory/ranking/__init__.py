"""How stored plans are scored for an embedding, and how the best ones are found."""
