"""Routes over a map: local problems one after another, joined in motion, at rest only at the stops."""
