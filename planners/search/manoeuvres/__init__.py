"""Tight manoeuvres from rest to rest: searched for from the goal outwards, then driven."""
