"""Names in earlier versions of the tables, which can still be read."""

from typing import Final

EARLIER: Final = {"attempts/2": "attempts/1", "recalls/2": "recalls/1"}  # schema: the one before
RENAMED: Final = {"recall": {"centroid": "encoder"}}  # column: old value, new value, since the second
