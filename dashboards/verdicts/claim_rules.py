"""When a claim holds, decided from estimates and their intervals.

An estimate decides if its 95 % interval lies on one side. A claim holds if all its estimates say so. It does
not if one says the opposite, with an interval widened for their number (Bonferroni). If an interval reaches
over the line, or something was not measured, the claim cannot be compared.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from dashboards.verdicts.evidence import Estimate

HOLDS: Final = "holds"
FAILS: Final = "does not hold"
OPEN: Final = "cannot be compared"
_SHOWN: Final = 3  # estimates that are written out, those that matter most first


class Claim(NamedTuple):
    """A claim of the paper, and whether it holds here."""

    text: str
    where: str  # section of the paper
    rule: str  # by which it is decided
    ours: str  # what was measured, in words
    verdict: str  # HOLDS, FAILS or OPEN
    method: str = ""  # what was measured: the product's defaults, or the paper's method


class Statement(NamedTuple):
    """An estimate, None if it was not measured, and whether it says what the claim says."""

    estimate: Estimate | None
    says: Callable[[Estimate], bool | None]

    def holds(self, together: int) -> bool | None:
        """Whether it says so, one of so many estimates ``together``; None if that is open or not measured."""
        if self.estimate is None:
            return None
        truth = self.says(self.estimate)
        return self.says(self.estimate.widened(together)) if truth is False else truth


def decided(text: str, where: str, rule: str, statements: list[Statement]) -> Claim:
    """Decide a claim by its ``statements``, all of which must hold.

    Args:
        text: as in ``Claim``.
        where: as in ``Claim``.
        rule: as in ``Claim``.
        statements: what has to hold for the claim to be confirmed.
    """
    together = sum(statement.estimate is not None for statement in statements)
    truths = [statement.holds(together) for statement in statements]
    verdict = FAILS if False in truths else OPEN if None in truths or not truths else HOLDS
    return Claim(text, where, rule, _in_words([each.estimate for each in statements], truths), verdict)


def _in_words(estimates: list[Estimate | None], truths: list[bool | None]) -> str:
    """How many estimates say what the claim says, and those that speak against it most."""
    measured = [(each, truth) for each, truth in zip(estimates, truths, strict=True) if each is not None]
    missing = len(estimates) - len(measured)
    if not measured:
        return "not measured"
    if len(measured) <= _SHOWN:
        words = "; ".join(str(estimate) for estimate, _ in measured)
    else:
        kinds = ((True, "as claimed"), (False, "against it"), (None, "undecided"))
        of_kind = {name: [each for each, truth in measured if truth is kind] for kind, name in kinds}
        counts = ", ".join(f"{len(estimates)} {name}" for name, estimates in of_kind.items() if estimates)
        weakest = of_kind["against it"] or of_kind["undecided"] or of_kind["as claimed"]
        shown = sorted(weakest, key=lambda each: abs(each.value), reverse=weakest is of_kind["against it"])
        words = f"of {len(measured)} figures {counts}; {'; '.join(map(str, shown[:_SHOWN]))}"
        words += "; …" if len(weakest) > _SHOWN else ""
    return f"{words}; {missing} not measured" if missing else words
