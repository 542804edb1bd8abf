"""Continual improvement: the same run with fewer experiences, from the first stage on (paper, IV-C)."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from tasks.settings.errors import UsageError
from tasks.settings.run_settings import CONTINUAL_CLASS, CONTINUAL_PLANNER, RunSettings

STEPS: Final = 5  # memories, the largest being the run's own


def runs_of_continual(settings: RunSettings) -> list[RunSettings]:
    """The run with a fifth, two fifths … of its experiences, chosen from as small a share of its candidates.

    There are none if ``continual`` is ``none``, or if it is ``paper``, which measures GUST on curves, and the
    run lacks one of them. Raises UsageError if there are too few experiences.
    """
    if settings.continual == "none":
        return []
    scope = replace(settings, combined=False, continual="none")
    if settings.continual == "paper":
        if CONTINUAL_CLASS not in settings.classes or CONTINUAL_PLANNER not in settings.planners:
            return []
        scope = replace(scope, classes=(CONTINUAL_CLASS,), worlds=(), planners=(CONTINUAL_PLANNER,))
    if settings.experiences < STEPS:
        raise UsageError(
            f"{settings.experiences} experiences: give {STEPS} or more for continual improvement."
        )
    return [
        replace(
            scope,
            experiences=settings.experiences * step // STEPS,
            candidates=settings.candidates * step // STEPS,
        )
        for step in range(1, STEPS)
    ]
