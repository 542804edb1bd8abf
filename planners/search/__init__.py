"""Planners from scratch: each a plain function `(problem, settings, rng, guide, scene) -> Outcome`."""
