"""Hallucination: many problems that a stored plan solves, made by one of four methods or a mix of them.

Each method is a file: ``rearrange`` (the paper's), ``maximal``, ``minimal``, ``learned``; ``no_plan`` makes
the problems that no stored plan solves, and ``mixture`` puts the methods together.
"""
