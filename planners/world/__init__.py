"""Where a robot moves: problems, the vehicle, collision, and the classes problems are drawn from."""
