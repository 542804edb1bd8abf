"""How stored plans are scored for an embedding, and the best of them found."""
