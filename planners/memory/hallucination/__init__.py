"""Hallucination: makes many problems that a stored plan solves, by one of four methods or a mix of them.

Each method has a file: ``rearrange`` (the paper's), ``maximal``, ``minimal``, ``learned_obstacles``.
``no_plan`` makes the problems that no stored plan solves, and ``mixture`` mixes the methods.
"""
