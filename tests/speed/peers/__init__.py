"""Our planners from scratch beside those of OMPL (docs/peers.md)."""
