"""What a run is asked to do: one frozen value, its presets, and the name that follows from it."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, get_args

from planners.world.vehicles.vehicle import VEHICLES
from tasks.settings.encoder_training import Learning
from tasks.settings.retraining_settings import Retraining

Objective = Literal["labels", "triplet"]


class Assist(NamedTuple):
    """How much of a memory an attempt may use."""

    name: str  # one of planners.solve.ASSISTS
    top_k: int  # recalled plans; 0 without memory
    recall: str | None = None  # a strategy of planners.memory.recall; None: the best for the memory's size


UNASSISTED: Final = Assist("none", 0)
ASSISTS: Final = (
    Assist("closed", 5),
    Assist("open", 5),
    Assist("repair", 5),
    Assist("closed", 1, "centroid"),  # the paper's four: what the encoder recalls, and nothing else
    Assist("closed", 5, "centroid"),
    Assist("open", 1, "centroid"),
    Assist("open", 5, "centroid"),
    Assist("fresh", 0),  # a control: no memory, a guide made on the spot
)
ABLATION: Final = (  # plans drawn blindly; the first two are the paper's
    Assist("random-open", 1),
    Assist("random-open", 5),
    Assist("random-repair", 5),
)
COLLECTOR: Final = "follow"  # its plans keep clear of obstacles, so more of them fit a new problem
ABLATION_PLANNER: Final = "gust"
CONTINUAL: Final = ("none", "paper", "all")  # the second: one planner on one class, as published
CONTINUAL_PLANNER: Final = "gust"
CONTINUAL_CLASS: Final = "curves"
DEFAULT_VEHICLE: Final = "car"
TAUGHT: Final = 1_000  # plans a class that the encoder is trained on; a larger memory grows beyond them
PICTURES: Final = (".png", ".svg", ".pdf")  # endings of what can be drawn
COMBINED: Final = "combined"  # the memory that does not distinguish the classes


class UsageError(ValueError):
    """What was asked cannot be done as asked; the message says what to ask instead (exit code 2)."""


class RunError(RuntimeError):
    """A stage cannot go on; the message is one line that says why and what to do (exit code 1)."""


Mixture = tuple[tuple[str, float], ...]  # methods of hallucination with their shares, which sum to 1
LARGEST_WEIGHT: Final = 1e9  # so that their sum is a number
DEFAULT_MIXTURE: Final[Mixture] = (("rearrange", 1.0),)

_LATER: Final[dict[str, Any]] = {  # fields that were added
    "vehicle": DEFAULT_VEHICLE,
    "optimised": False,
    "learning": asdict(Learning()),
    "hallucination": DEFAULT_MIXTURE,
    "candidates": 0,
    "continual": "none",
    "learned": "",
    "retraining": None,
}


@dataclass(frozen=True)
class RunSettings:
    """One run. Equal settings, wherever the data lies and whoever works, give equal rows."""

    preset: str
    classes: tuple[str, ...]  # generated problem classes
    worlds: tuple[str, ...]  # folders of worlds, or maps; each is one more class, named as its folder or file
    difficulty: str
    seed: int
    objective: Objective
    experiences: int  # solved problems kept a class
    problems_per_experience: int  # hallucinated for each plan that is taught, its own problem included
    test_problems: int  # unseen problems a class
    collector: str  # the planner whose plans are kept
    planners: tuple[str, ...]  # those that are measured
    assists: tuple[Assist, ...]  # how, besides without memory
    epochs: int
    combined: bool  # also one memory for all classes together
    strict: bool = False  # a bad world stops the run instead of being skipped
    vehicle: str = DEFAULT_VEHICLE  # its name (``planners.world.vehicles.vehicle``)
    optimised: bool = False  # collected plans are made shorter and clearer before they are kept
    learning: Learning = field(default_factory=Learning)  # how encoders are trained
    hallucination: Mixture = DEFAULT_MIXTURE  # how problems are made around a plan
    candidates: int = 0  # solved problems a class that experiences are chosen of; few: the first are kept

    learned: str = ""  # snapshot of what was learned on the job, and a digest of it; more candidates
    continual: str = "none"  # whose planning times are measured with fewer experiences too, of CONTINUAL
    retraining: Retraining | None = None  # what it begins from, where it is one

    @property
    def wanted(self) -> int:
        """Solved problems a class to collect."""
        return max(self.candidates, self.experiences)

    @property
    def class_names(self) -> tuple[str, ...]:
        """All classes of the run, folders of worlds after the generated ones."""
        return self.classes + tuple(world_class(folder) for folder in self.worlds)

    @property
    def memory_names(self) -> tuple[str, ...]:
        """Names of the memories of the run: its classes, then the combined one if it has one."""
        return self.class_names + ((COMBINED,) if self.combined else ())

    def classes_of(self, memory: str) -> tuple[str, ...]:
        """The classes that a memory is made for."""
        return self.class_names if memory == COMBINED else (memory,)

    def memories_of(self, class_name: str) -> list[str]:
        """The memories that are measured on a class: its own, and the combined one if there is one."""
        return [class_name, COMBINED] if self.combined else [class_name]

    @property
    def taught(self) -> int:
        """How many experiences of a class problems are hallucinated for: the first, that encoders learn."""
        return min(self.experiences, TAUGHT)

    @property
    def grown(self) -> bool:
        """Whether memories have more plans than their encoders were taught (``planners.memory.growth``)."""
        return self.experiences > self.taught

    @property
    def digest(self) -> str:
        """Eight hexadecimal digits that tell settings with different results apart."""
        asked = asdict(self) | {"worlds": [world_class(folder) for folder in self.worlds]}
        del asked["strict"], asked["continual"]
        for name, default in _LATER.items():  # runs with these were made, and named, before there was another
            if asked.get(name) == default:
                del asked[name]
        return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:8]

    @property
    def run_name(self) -> str:
        """Name of the run's folder and of its parent run in MLflow, like ``laptop-labels-3f2a91c0``.

        Of another vehicle than the car it says the name, like ``laptop-labels-car-1-trailer-81d5c2e7``.
        """
        driven = [] if self.vehicle == DEFAULT_VEHICLE else [self.vehicle]
        return "-".join([self.preset, self.objective, *driven, self.digest])

    def to_json(self) -> str:
        """The settings as one JSON object; ``from_json`` gives them back."""
        return json.dumps(asdict(self), indent=2, sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> RunSettings:
        """The settings that ``to_json`` wrote; ValueError with one line when they are of another version."""
        values: dict[str, Any] = _LATER | json.loads(text)
        known = {field.name for field in fields(cls)}
        if set(values) != known:
            odd = ", ".join(sorted(set(values) ^ known))
            raise ValueError(
                f"Settings of another version: {odd} missing or unknown. Start a new data folder."
            )
        values["assists"] = tuple(Assist(*assist) for assist in values["assists"])
        values["hallucination"] = tuple((name, float(share)) for name, share in values["hallucination"])
        for name in ("classes", "worlds", "planners"):
            values[name] = tuple(values[name])
        values["learning"] = Learning(**values["learning"])
        if values["retraining"] is not None:
            values["retraining"] = Retraining(**values["retraining"])
        return cls(**values)


def default_data() -> Path:
    """The data folder of a command that was given none: $MOTION_MEMORY_DATA or ./data."""
    return Path(os.environ.get("MOTION_MEMORY_DATA") or "data")


def default_scheduler() -> str | None:
    """The Dask scheduler that $MOTION_MEMORY_SCHEDULER names; None: a command has workers of its own."""
    return os.environ.get("MOTION_MEMORY_SCHEDULER") or None


def world_class(path: str | Path) -> str:
    """The class name of worlds or of a map: the folder's name, or the file's without its ending."""
    place = Path(path).resolve()
    return place.name if place.is_dir() else place.stem


class _Preset(NamedTuple):
    experiences: int
    candidates: int
    problems_per_experience: int
    test_problems: int
    epochs: int
    combined: bool
    continual: str


PRESETS: Final = {
    "smoke": _Preset(6, 20, 20, 20, 2, False, "none"),
    "laptop": _Preset(100, 1_000, 200, 1_000, 10, False, "none"),
    "paper": _Preset(100, 1_000, 1_000, 10_000, 10, True, "paper"),
}


def for_preset(
    preset: str = "laptop",
    *,
    classes: Sequence[str] | None = None,
    worlds: Sequence[str] = (),
    difficulty: str = "standard",
    seed: int = 1,
    objective: str = "labels",
    planners: Sequence[str] | None = None,
    experiences: int | None = None,
    candidates: int | None = None,
    problems_per_experience: int | None = None,
    test_problems: int | None = None,
    epochs: int | None = None,
    strict: bool = False,
    vehicle: str = DEFAULT_VEHICLE,
    optimised: bool = False,
    continual: str | None = None,
    learning: Mapping[str, Any] | None = None,
    hallucination: Sequence[str] | None = None,
) -> RunSettings:
    """Settings of a preset with some values replaced; UsageError with one line when one is not possible.

    Without ``classes`` a run takes every generated class, or, with ``worlds``, these alone.
    """
    from planners.search.registry import PLANNERS  # imported late: Numba costs half a second
    from planners.world.classes.problem_classes import CLASSES, DIFFICULTIES

    check_known("preset", [preset], PRESETS)
    base = PRESETS[preset]
    asked = tuple(CLASSES) if classes is None and not worlds else tuple(dict.fromkeys(classes or ()))
    named = tuple(PLANNERS) if planners is None else tuple(dict.fromkeys(planners))
    check_known("class", asked, CLASSES)
    check_known("planner", named, PLANNERS)
    check_known("difficulty", [difficulty], DIFFICULTIES)
    check_known("objective", [objective], get_args(Objective))
    check_known("vehicle", [vehicle], VEHICLES)
    check_known("continual improvement", [continual or base.continual], CONTINUAL)
    if not asked and not worlds:
        raise UsageError(f"No class to work on. Name some of: {', '.join(CLASSES)}.")
    if not named:
        raise UsageError(f"No planner to measure. Name some of: {', '.join(PLANNERS)}.")
    for folder in worlds:
        if not Path(folder).exists():
            raise UsageError(f"{folder} is no folder of worlds and no map: there is nothing of that name.")
        parts = {part: (Path(folder) / part).is_dir() for part in ("train", "test")}
        if any(parts.values()) and not all(parts.values()):
            raise UsageError(f"{folder} has only one of the parts {' and '.join(parts)}; both are needed.")
    if seed < 0:
        raise UsageError(f"Seed {seed} is negative. Give 0 or more.")
    kept = _count("experiences", experiences, base.experiences)
    if candidates is not None and candidates < kept:
        raise UsageError(f"{candidates} candidates for {kept} experiences: give as many or more.")
    settings = RunSettings(
        preset=preset,
        classes=asked,
        worlds=tuple(str(Path(folder).resolve()) for folder in worlds),
        difficulty=difficulty,
        seed=seed,
        objective="triplet" if objective == "triplet" else "labels",
        experiences=kept,
        problems_per_experience=_count(
            "problems a plan", problems_per_experience, base.problems_per_experience
        ),
        test_problems=_count("test problems", test_problems, base.test_problems),
        collector=COLLECTOR,
        planners=named,
        assists=ASSISTS,
        epochs=_count("epochs", epochs, base.epochs),
        combined=base.combined,
        strict=strict,
        vehicle=vehicle,
        optimised=optimised,
        learning=_learning(learning or {}),
        hallucination=DEFAULT_MIXTURE if hallucination is None else mixture_of(hallucination),
        candidates=max(base.candidates, kept) if candidates is None else candidates,
        continual=continual or base.continual,
    )
    names = settings.class_names
    twice = sorted({name for name in names if names.count(name) > 1} | ({COMBINED} & set(names)))
    if twice:
        raise UsageError(f"Two classes would be called {', '.join(twice)}. Rename the folder of worlds.")
    return settings


def mixture_of(asked: Sequence[str]) -> Mixture:
    """The shares of hallucination methods asked for like ``rearrange=0.7``; a name alone weighs 1.

    UsageError with one line for an unknown or repeated name, or a weight that is no number above 0.
    """
    from planners.memory.hallucination.mixture import METHODS  # imported late: Numba costs half a second

    weights: dict[str, float] = {}
    for each in asked:
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
        raise UsageError(f"No hallucination method. Name some of: {', '.join(METHODS)}.")
    whole = math.fsum(weights.values())
    return tuple((name, weights[name] / whole) for name in METHODS if name in weights)


def check_known(kind: str, asked: Sequence[str], known: Sequence[str] | Mapping[str, Any]) -> None:
    """UsageError with the known names where one that was asked for is not among them."""
    for name in asked:
        if name not in known:
            raise UsageError(f"Unknown {kind} {name!r}. Known: {', '.join(known)}.")


def _learning(asked: Mapping[str, Any]) -> Learning:
    try:
        return Learning(**asked)
    except ValueError as error:
        raise UsageError(str(error)) from None


def check_picture(path: Path | None) -> None:
    """UsageError where a path that was asked for does not end as a picture does."""
    if path is not None and path.suffix not in PICTURES:
        raise UsageError(f"{path} is no picture's name. Known: {', '.join(PICTURES)}.")


def _count(what: str, asked: int | None, otherwise: int) -> int:
    if asked is None:
        return otherwise
    if asked < 1:
        raise UsageError(f"{asked} {what}: give 1 or more.")
    return asked
