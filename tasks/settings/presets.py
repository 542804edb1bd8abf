"""Presets: the sizes of a run, and the settings of one with some values replaced."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, get_args

from tasks.settings.checks import check_count, check_known, check_seed, checked_vehicle
from tasks.settings.encoder_training import Learning
from tasks.settings.errors import UsageError
from tasks.settings.run_settings import (
    ASSISTS,
    COLLECTOR,
    COMBINED,
    CONTINUAL,
    DEFAULT_MIXTURE,
    DEFAULT_VEHICLE,
    PUBLISHED_ASSISTS,
    Assist,
    Mixture,
    Objective,
    RunSettings,
)

LARGEST_WEIGHT: Final = 1e9  # keeps sums of weights finite


class Method(NamedTuple):
    """How memories are made and measured; the fields are those of ``RunSettings``."""

    objective: Objective
    as_published: bool
    assists: tuple[Assist, ...]
    learning: Mapping[str, Any]
    collector: str = COLLECTOR
    planners: tuple[str, ...] = ()  # none: all


OURS: Final = Method("labels", False, ASSISTS, {})
PUBLISHED: Final = Method(  # the paper, and the code of its authors (docs/studies/paper-method.md)
    "triplet", True, PUBLISHED_ASSISTS,
    {"network": "pooled", "channels": (8, 16, 32), "hidden": (128, 64), "own_anchors": True,
     "batch": 64, "learning_rate": 1e-3, "weight_decay": 0.0, "patience": 60},
    "follow", ("rrt", "gust", "follow"),
)  # fmt: skip


class Preset(NamedTuple):
    """The size of a run and its method; the fields are those of ``RunSettings``."""

    experiences: int
    candidates: int  # 0: as many as experiences, so there is no choice
    problems_per_experience: int
    test_problems: int
    epochs: int
    combined: bool
    continual: str
    method: Method = OURS


PRESETS: Final = {
    "smoke": Preset(6, 20, 20, 20, 2, False, "none"),
    "laptop": Preset(100, 1_000, 200, 1_000, 10, False, "none"),
    "paper": Preset(100, 1_000, 1_000, 10_000, 6, True, "paper"),
    "paper-method": Preset(100, 0, 1_000, 10_000, 60, True, "paper", PUBLISHED),
    "paper-method-laptop": Preset(100, 0, 200, 1_000, 20, False, "none", PUBLISHED),
}


def for_preset(
    preset: str = "laptop",
    *,
    classes: Sequence[str] | None = None,
    worlds: Sequence[str] = (),
    difficulty: str = "standard",
    seed: int = 1,
    objective: str | None = None,
    planners: Sequence[str] | None = None,
    experiences: int | None = None,
    candidates: int | None = None,
    problems_per_experience: int | None = None,
    test_problems: int | None = None,
    epochs: int | None = None,
    strict: bool = False,
    vehicle: str = DEFAULT_VEHICLE,
    continual: str | None = None,
    learning: Mapping[str, Any] | None = None,
    hallucination: Sequence[str] | None = None,
) -> RunSettings:
    """The settings of a preset with some values replaced.

    Arguments are the fields of ``RunSettings``; None means as in the preset. Without ``classes`` a run takes
    every generated class, or none if it has ``worlds``; without ``planners`` it measures all of them.
    ``learning`` holds fields of ``Learning``, and ``hallucination`` what ``mixture_of`` takes. A UsageError
    says in one line which value is not possible.
    """
    from planners.search.registry import PLANNERS  # imported late: Numba costs half a second
    from planners.world.classes.problem_classes import CLASSES, DIFFICULTIES

    check_known("preset", [preset], PRESETS)
    base = PRESETS[preset]
    method = base.method
    objective = objective or method.objective
    generated = tuple(CLASSES) if classes is None and not worlds else tuple(dict.fromkeys(classes or ()))
    measured = method.planners or tuple(PLANNERS) if planners is None else tuple(dict.fromkeys(planners))
    check_known("class", generated, CLASSES)
    check_known("planner", measured, PLANNERS)
    check_known("difficulty", [difficulty], DIFFICULTIES)
    check_known("objective", [objective], get_args(Objective))
    vehicle = checked_vehicle(vehicle)
    check_known("continual improvement", [continual or base.continual], CONTINUAL)
    check_seed(seed)
    if not generated and not worlds:
        raise UsageError(f"There is no class to work on: name some of {', '.join(CLASSES)}.")
    if not measured:
        raise UsageError(f"There is no planner to measure: name some of {', '.join(PLANNERS)}.")
    for folder in worlds:
        _check_worlds(Path(folder))
    kept = _count("experiences", experiences, base.experiences)
    if candidates is not None and candidates < kept:
        raise UsageError(f"{candidates} candidates are fewer than {kept} experiences: give as many or more.")
    settings = RunSettings(
        preset=preset,
        classes=generated,
        worlds=tuple(str(Path(folder).resolve()) for folder in worlds),
        difficulty=difficulty,
        seed=seed,
        objective="triplet" if objective == "triplet" else "labels",
        experiences=kept,
        problems_per_experience=_count(
            "problems a plan", problems_per_experience, base.problems_per_experience
        ),
        test_problems=_count("test problems", test_problems, base.test_problems),
        collector=method.collector,
        planners=measured,
        assists=method.assists,
        epochs=_count("epochs", epochs, base.epochs),
        combined=base.combined,
        strict=strict,
        vehicle=vehicle,
        learning=_learning({**method.learning, **(learning or {})}),
        hallucination=DEFAULT_MIXTURE if hallucination is None else mixture_of(hallucination),
        candidates=max(base.candidates, kept) if candidates is None else candidates,
        continual=continual or base.continual,
        as_published=method.as_published,
    )
    names = settings.class_names
    twice = sorted({name for name in names if names.count(name) > 1} | ({COMBINED} & set(names)))
    if twice:
        raise UsageError(f"Two classes would be called {', '.join(twice)}. Rename the folder of worlds.")
    return settings


def mixture_of(weighted: Sequence[str]) -> Mixture:
    """The shares of hallucination methods.

    Args:
        weighted: methods with weights, like ``rearrange=0.7``; a name alone weighs 1.

    Raises:
        UsageError: a name is unknown or given twice, or a weight is not a number above 0.
    """
    from planners.memory.hallucination.mixture import METHODS  # imported late: Numba costs half a second

    weights: dict[str, float] = {}
    for each in weighted:
        name, equals, weight = each.partition("=")
        check_known("hallucination method", [name], METHODS)
        try:
            value = float(weight) if equals else 1.0
        except ValueError:
            value = math.nan
        if not 0.0 < value <= LARGEST_WEIGHT:
            raise UsageError(f"Hallucination {each!r}: give a weight above 0, like {name}=0.5.")
        if name in weights:
            raise UsageError(f"Hallucination method {name} is given twice. Give each once.")
        weights[name] = value
    if not weights:
        raise UsageError(f"There is no hallucination method: name some of {', '.join(METHODS)}.")
    total = math.fsum(weights.values())
    return tuple((name, weights[name] / total) for name in METHODS if name in weights)


def _check_worlds(path: Path) -> None:
    if not path.exists():
        raise UsageError(f"{path} does not exist; give a folder of worlds or a map.")
    parts = {part: (path / part).is_dir() for part in ("train", "test")}
    if any(parts.values()) and not all(parts.values()):
        raise UsageError(f"{path} has only one of the parts {' and '.join(parts)}; both are needed.")


def _count(what: str, given: int | None, default: int) -> int:
    count = default if given is None else given
    check_count(what, count)
    return count


def _learning(fields: Mapping[str, Any]) -> Learning:
    try:
        return Learning(**fields)
    except ValueError as error:
        raise UsageError(str(error)) from None
