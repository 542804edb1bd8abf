"""The settings of a run: one frozen value, and the name that follows from it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

from planners.memory.encoder.training import TrainingSettings
from planners.world.vehicles.vehicle import name_of
from storage.places.run_folder import worlds_name
from storage.tables.earlier_versions import RENAMED
from storage.vehicles.vehicle_files import label_of, said_vehicle
from tasks.settings.encoder_training import Learning
from tasks.settings.errors import UsageError
from tasks.settings.retraining_settings import Retraining

Objective = Literal["labels", "triplet"]


class Assist(NamedTuple):
    """How much of a memory an attempt may use."""

    name: str  # one of planners.solve.ASSISTS
    top_k: int  # recalled plans; 0 without memory
    recall: str | None = None  # a strategy of planners.memory.recall; None: the best for the memory's size
    polished: bool = False  # whether plans are polished, as answers are, or as they were found


UNASSISTED: Final = Assist("none", 0)
ASSISTS: Final = (
    Assist("closed", 5),
    Assist("open", 5),
    Assist("repair", 5),
    Assist("closed", 1, "encoder"),  # the paper's four: what the encoder recalls, and nothing else
    Assist("closed", 5, "encoder"),
    Assist("open", 1, "encoder"),
    Assist("open", 5, "encoder"),
    Assist("fresh", 0),  # a control: no memory, a guide made on the spot
    Assist("none", 0, polished=True),  # as answers are returned, without and with a memory
    Assist("repair", 5, polished=True),
)
PUBLISHED_ASSISTS: Final = (
    Assist("closed", 1, "centroid"),
    Assist("closed", 5, "centroid"),
    Assist("published-open", 1, "centroid"),
    Assist("published-open", 5, "centroid"),
)
ABLATION: Final = (  # plans drawn blindly, for runs that have the same assist with plans recalled
    Assist("random-open", 1),
    Assist("random-open", 5),
    Assist("random-repair", 5),
    Assist("random-published-open", 1),
    Assist("random-published-open", 5),
)
ANSWERING: Final = "lattice"  # the planner that answers by default, which alone is measured polished, too
COLLECTOR: Final = "lattice"  # its plans drive shortest, and polish makes them clear of obstacles
ABLATION_PLANNER: Final = "gust"
CONTINUAL: Final = ("none", "paper", "all")  # the second: one planner on one class, as published
CONTINUAL_PLANNER: Final = "gust"
CONTINUAL_CLASS: Final = "curves"
DEFAULT_VEHICLE: Final = "car"
TAUGHT: Final = 1_000  # plans a class that the encoder is trained on; a larger memory grows beyond them
COMBINED: Final = "combined"  # the memory that does not distinguish the classes

Mixture = tuple[tuple[str, float], ...]  # methods of hallucination with their shares, which sum to 1
DEFAULT_MIXTURE: Final[Mixture] = (("rearrange", 1.0),)

_LATER: Final[dict[str, Any]] = {  # fields that were added
    "vehicle": DEFAULT_VEHICLE,
    "learning": asdict(Learning(origin_weight=40.0)),  # as it was when the field was added
    "hallucination": DEFAULT_MIXTURE,
    "candidates": 0,
    "continual": "none",
    "learned": "",
    "retraining": None,
    "as_published": False,
    "left_out": (),
}
_LATER_IN_LEARNING: Final = ("own_anchors", "batch", "weight_decay", "network")

VERSION: Final = 2  # of the JSON; in the first, which has no number, ``encoder`` was called ``centroid``
_DIGESTED: Final = {
    "encoder": "centroid",
    "centroid": "nearest centroid",
}  # so that older runs keep their names


@dataclass(frozen=True)
class RunSettings:
    """One run. Equal settings, wherever the data lies and whoever works, give equal rows."""

    preset: str
    classes: tuple[str, ...]  # generated problem classes
    worlds: tuple[str, ...]  # folders of worlds, or maps; each is one more class, named as its folder or file
    difficulty: str
    seed: int
    objective: Objective
    experiences: int  # solved problems that are kept of a class
    problems_per_experience: int  # hallucinated for each plan that is taught, its own problem included
    test_problems: int  # unseen problems of a class
    collector: str  # the planner whose plans are kept
    planners: tuple[str, ...]  # those that are measured
    assists: tuple[Assist, ...]  # that they are measured with, besides none
    epochs: int
    combined: bool  # also one memory for all classes together
    strict: bool = False  # a bad world stops the run instead of being skipped
    vehicle: str = DEFAULT_VEHICLE  # its name, or all of it (``storage.vehicles.vehicle_files``)
    learning: Learning = field(default_factory=Learning)  # how encoders are trained
    hallucination: Mixture = DEFAULT_MIXTURE  # how problems are made around a plan
    candidates: int = 0  # solved problems of a class to choose experiences from; few: the first are kept
    learned: str = ""  # a snapshot of experiences gained on the job: more candidates
    continual: str = "none"  # whose planning times are measured with fewer experiences too, of CONTINUAL
    retraining: Retraining | None = None  # what it begins from, if it is one
    as_published: bool = False  # plans stay as they were found; no problems but those made around them
    left_out: tuple[str, ...] = ()  # classes of which collecting found too few experiences

    @property
    def wanted(self) -> int:
        """How many solved problems of each class to collect."""
        return max(self.candidates, self.experiences)

    @property
    def class_names(self) -> tuple[str, ...]:
        """The classes of the run but those left out, folders of worlds after the generated ones."""
        every = self.classes + tuple(world_class(folder) for folder in self.worlds)
        return tuple(name for name in every if name not in self.left_out)

    @property
    def title(self) -> str:
        """What people call the run: its preset, classes and seed, like ``laptop trap seed 1``."""
        return " ".join([self.preset, *self.class_names, f"seed {self.seed}"])

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

    def assists_of(self, planner: str) -> list[Assist]:
        """The assists that a planner is measured with; only answers of ``ANSWERING`` are polished."""
        return [each for each in self.assists if not each.polished or planner == ANSWERING]

    @property
    def ablation(self) -> list[Assist]:
        """Plans drawn blindly, for each assist that is measured with plans recalled."""
        recalled = {assist.name for assist in self.assists}
        return [each for each in ABLATION if each.name.removeprefix("random-") in recalled]

    @property
    def taught(self) -> int:
        """How many experiences of a class, the first ones, encoders are taught."""
        return min(self.experiences, TAUGHT)

    @property
    def grown(self) -> bool:
        """Whether memories have more plans than their encoders were taught (``planners.memory.growth``)."""
        return self.experiences > self.taught

    def training(self, learning: Learning, seed: int) -> TrainingSettings:
        """All settings of training one encoder of the run, with a way of ``learning`` and a seed."""
        settings = learning.settings(self.objective, self.epochs, seed)
        # with very many plans, the readout alone picks candidates, so it has to know what the cells say
        return replace(settings, by_cells=not self.grown)

    def for_retraining(self) -> RunSettings:
        """These settings without being measured with fewer experiences.

        Raises UsageError if they name a snapshot of what was learned.
        """
        if self.learned:
            raise UsageError(
                "--learned cannot be used for retraining, which takes a snapshot of its own; leave it out."
            )
        return replace(self, continual="none")

    @property
    def vehicle_name(self) -> str:
        """The name of its vehicle."""
        return name_of(said_vehicle(self.vehicle))

    @property
    def vehicle_label(self) -> str:
        """A word that tells its vehicle from all others."""
        return label_of(said_vehicle(self.vehicle))

    @property
    def digest(self) -> str:
        """Eight hexadecimal digits that tell settings with different results apart."""
        values = asdict(self) | {"worlds": [world_class(folder) for folder in self.worlds]}
        del values["strict"], values["continual"], values["left_out"]
        values["assists"] = [_digested(each) for each in self.assists]
        for name, default in _LATER.items():  # so that runs from before a field was added keep their names
            if values.get(name) == default:
                del values[name]
        for name in _LATER_IN_LEARNING if "learning" in values else ():
            if values["learning"][name] == _LATER["learning"][name]:
                del values["learning"][name]
        return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:8]

    @property
    def run_name(self) -> str:
        """Name of the run's folder and of its parent run in MLflow, like ``laptop-labels-3f2a91c0``.

        It names the vehicle unless that is the car, like ``laptop-labels-car-1-trailer-81d5c2e7``.
        """
        vehicle = [] if self.vehicle == DEFAULT_VEHICLE else [self.vehicle_name]
        return "-".join([self.preset, self.objective, *vehicle, self.digest])

    def to_json(self) -> str:
        """The settings as one JSON object; ``from_json`` gives them back."""
        return json.dumps({"version": VERSION} | asdict(self), indent=2, sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> RunSettings:
        """The settings that ``to_json`` wrote; ValueError with one line if they are of another version."""
        values: dict[str, Any] = _LATER | json.loads(text)
        values.pop("optimised", None)  # once a choice; now every collected plan is polished
        version = values.pop("version", 1)
        names = {field.name for field in fields(cls)}
        if set(values) != names:
            odd = ", ".join(sorted(set(values) ^ names))
            raise ValueError(
                f"Settings of another version: {odd} missing or unknown. Start a new data folder."
            )
        values["assists"] = tuple(Assist(*assist) for assist in values["assists"])
        if version == 1:
            values["assists"] = tuple(_renamed(each, RENAMED["recall"]) for each in values["assists"])
        values["hallucination"] = tuple((name, float(share)) for name, share in values["hallucination"])
        for name in ("classes", "worlds", "planners", "left_out"):
            values[name] = tuple(values[name])
        values["learning"] = Learning(**values["learning"])
        if values["retraining"] is not None:
            values["retraining"] = Retraining(**values["retraining"])
        return cls(**values)


def _digested(assist: Assist) -> tuple[Any, ...]:
    """The fields of an ``assist`` that count in a digest: ``polished``, added later, only if true."""
    fields_of = _renamed(assist, _DIGESTED)._asdict().items()
    return tuple(value for name, value in fields_of if name != "polished" or value)


def _renamed(assist: Assist, names: dict[str, str]) -> Assist:
    return assist._replace(recall=assist.recall and names.get(assist.recall, assist.recall))


def world_class(path: str | Path) -> str:
    """The class of worlds or of a map (``worlds_name``), wherever the path leads."""
    return worlds_name(Path(path).resolve())
