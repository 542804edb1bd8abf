"""Large maps: what is occupied, in few convex pieces; local problems cut from them."""
