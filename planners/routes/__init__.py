"""Routes over a map: local problems one after the other, joined where the vehicle comes to rest."""
