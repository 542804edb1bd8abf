"""When a claim holds: decided from its figures and their intervals, and told in words.

A figure decides when its 95 % interval lies on one side. A claim holds when all its figures say so; it does
not when one says the opposite, with an interval widened for their number (Bonferroni). Where an interval
reaches over the line, or a figure was not measured, nothing is decided: "cannot be compared".
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from dashboards.verdicts.evidence import Figure

HOLDS: Final = "holds"
FAILS: Final = "does not hold"
OPEN: Final = "cannot be compared"
_SHOWN: Final = 3  # figures that are written out, those that matter most first


class Claim(NamedTuple):
    """A claim of the paper and what became of it."""

    text: str
    where: str  # in the paper
    rule: str  # how it is decided
    ours: str  # what was measured
    verdict: str  # HOLDS, FAILS or OPEN


class Statement(NamedTuple):
    """A figure, None where it was not measured, and when it says what the claim says."""

    figure: Figure | None
    says: Callable[[Figure], bool | None]

    def holds(self, together: int) -> bool | None:
        """Whether it says so, beside as many others; None where it is undecided or not measured."""
        if self.figure is None:
            return None
        said = self.says(self.figure)
        return self.says(self.figure.widened(together)) if said is False else said


def decided(text: str, where: str, rule: str, statements: list[Statement]) -> Claim:
    """All statements must hold; one that is false settles it."""
    measured = [each for each in statements if each.figure is not None]
    truths = [each.holds(len(measured)) for each in statements]
    verdict = FAILS if False in truths else OPEN if None in truths or not truths else HOLDS
    figures = [each.figure for each in statements]
    return Claim(text, where, rule, _told(figures, truths), verdict)


def _told(figures: list[Figure | None], truths: list[bool | None]) -> str:
    """The figures in words: how many say what the claim says, and the ones that speak against it most."""
    measured = [(figure, holds) for figure, holds in zip(figures, truths, strict=True) if figure is not None]
    missing = len(figures) - len(measured)
    if not measured:
        return "not measured"
    if len(measured) <= _SHOWN:
        told = "; ".join(str(figure) for figure, _ in measured)
    else:
        sorts = ((True, "as claimed"), (False, "against it"), (None, "undecided"))
        found = {name: [figure for figure, holds in measured if holds is truth] for truth, name in sorts}
        counts = ", ".join(f"{len(named)} {name}" for name, named in found.items() if named)
        weakest = found["against it"] or found["undecided"] or found["as claimed"]
        shown = sorted(weakest, key=lambda figure: abs(figure.value), reverse=weakest is found["against it"])
        told = f"of {len(measured)} figures {counts}; {'; '.join(map(str, shown[:_SHOWN]))}"
        told += "; …" if len(weakest) > _SHOWN else ""
    return f"{told}; {missing} not measured" if missing else told
