"""How long each way to plan takes to a plan of some quality; ``__main__.py`` says how it is asked."""
