"""Routes over a map: local problems one after another, joined where the vehicle rests."""
