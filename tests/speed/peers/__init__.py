"""Our planners from scratch beside those of OMPL (docs/studies/peers.md)."""
