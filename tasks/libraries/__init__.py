"""Libraries of plans that are retrained: gathered anew with what was learned, and judged."""
