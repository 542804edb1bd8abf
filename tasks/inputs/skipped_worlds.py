"""Skipped worlds, summarised by reason."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

NAMED: Final = 3  # worlds that are named for each reason
_NUMBER: Final = re.compile(r"(?<!\w)[+-]?\d[\d.]*\b")  # but not in names


def summed_up(skipped: Sequence[tuple[str, str]]) -> str:
    """Say how many worlds were skipped, and for each reason how many, with the first of them.

    Args:
        skipped: where each world is, and why it was skipped. Reasons that differ only in numbers count
            as one.
    """
    reasons: dict[str, list[tuple[str, str]]] = {}
    for world, reason in skipped:
        reasons.setdefault(_NUMBER.sub("…", reason), []).append((world, reason))
    lines = [f"{len(skipped):,} skipped (use --strict to stop instead):"]
    for alike in sorted(reasons.values(), key=len, reverse=True):
        worlds = ", ".join(world for world, _ in alike[:NAMED])
        more = f" and {len(alike) - NAMED:,} more" if len(alike) > NAMED else ""
        lines.append(f"{len(alike):,} × {alike[0][1]}: {worlds}{more}")
    return "\n  ".join(lines)
