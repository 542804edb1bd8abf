"""Malformed questions and vehicles: is each refused in one line, or answered soundly where it makes sense?

``python -m tests.trials.malformed [--count 10000] [--seed 94]`` takes sound files of general questions and of
vehicles in turn, and spoils each in some ways: odd values, numbers far too large or a little off, fields left
out, unknown or repeated, texts cut off. What is read nevertheless must be of use: a question is planned, and
so is one for each vehicle, and plans are judged. It prints how many were refused and read, and ends with exit
code 1 if there was an error of more than one line, a traceback or a faulty plan.
"""

from __future__ import annotations

import argparse
import json
import logging
import random
import sys
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import yaml

from planners.search.query import Limits
from planners.solve import solve
from planners.world.alignment import from_canonical, to_canonical
from planners.world.authority.authority import faults
from planners.world.problem import Problem
from planners.world.vehicles.vehicle import Vehicle
from planners.world.workspace import Workspace
from storage.errors import StorageError
from storage.exchange.problems import fields_of, read_problems
from storage.vehicles.definitions import definition_of, vehicle_of
from storage.vehicles.vehicle_files import read_vehicle
from tests.trials.judged_plans.fleet import FLEET
from tests.trials.judged_plans.hard_questions import question_of

ODD: Final = (
    None, True, 0, -1, 1, 1e308, -1e308, 1e-320, 10**400, float("nan"), float("inf"), "", "x", "5e-2", [], {},
    [[]], [None], {"a": 1}, "\u0000", [[1, 2]], [[1, 2], [3, 4], [5, 6]], [0.5, 0.5], [0, 1, 2],
)  # fmt: skip
FACTORS: Final = (-1.0, 0.0, 1e-9, 1e-3, 0.1, 0.5, 0.99, 1.01, 2.0, 10.0, 1e3, 1e9)
UNKNOWN: Final = ("goal_sped", "start_hitches", "limit", "moving", "Body", "", "1")
LONGEST: Final = 600  # characters of a message
LIMITS: Final = Limits(expansions=300)
ASKED: Final = 2  # questions for each vehicle that is read
WORKSPACE: Final = Workspace()

Place = tuple[Any, Any]  # an object or a list, and a name or number in it


def places_in(fields: Any) -> Iterator[Place]:
    """Everything that can be spoiled in fields, at any depth."""
    for key in list(fields) if isinstance(fields, dict) else range(len(fields)):
        yield fields, key
        if isinstance(fields[key], dict | list):
            yield from places_in(fields[key])


def spoiled(fields: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """A copy of the fields with one to three things spoiled."""
    fields = deepcopy(fields)
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        top = rng.random() < 0.5  # most places lie in long lists of corners
        places = [(fields, name) for name in fields] if top else list(places_in(fields))
        if not places:
            break
        within, key = rng.choice(places)
        value, how = within[key], rng.randrange(6)
        if how <= 1 and isinstance(value, float):
            within[key] = value * rng.choice(FACTORS)
        elif how == 2 and isinstance(value, list) and value:
            within[key] = value + value[: rng.choice([1, 1, 50])] if rng.random() < 0.5 else value[:-1]
        elif how == 3:
            del within[key]
        elif how == 4 and isinstance(within, dict):
            within[rng.choice(UNKNOWN)] = value
        else:
            within[key] = deepcopy(rng.choice(ODD))
    return fields


def spoiled_text(text: str, rng: random.Random) -> bytes:
    """The text, now and then cut off, with other bytes in it, or with a part of it twice."""
    data, how = bytearray(text.encode()), rng.randrange(12)
    if how == 0:
        del data[rng.randrange(len(data)) :]
    elif how == 1:
        for _ in range(rng.randrange(1, 5)):
            data[rng.randrange(len(data))] = rng.randrange(256)
    elif how == 2:
        first = rng.randrange(len(data))
        data += data[first : first + rng.randrange(200)]
    return bytes(data)


def answered(asked: Problem, vehicle: Vehicle, seed: int) -> str:
    """What is wrong with the answer to a question; nothing mostly."""
    canonical, alignment = to_canonical(asked)
    plan = solve(
        canonical, "lattice", limits=LIMITS, vehicle=vehicle, seed=seed, workspace=WORKSPACE, polished=False
    ).plan
    return "" if plan is None else "; ".join(faults(asked, from_canonical(plan, alignment), vehicle))


def question_read(folder: Path, seed: int, index: int) -> tuple[str, str]:
    """What became of a spoiled question: an outcome, and what is wrong with it."""
    rng = random.Random(f"question {seed} {index}")
    vehicle = FLEET[rng.choice(list(FLEET))]
    asked = question_of(seed, index, vehicle)
    if asked is None:
        return "no room", ""
    fields = spoiled(fields_of(asked, vehicle), rng)
    path = folder / rng.choice(["question.json", "question.jsonl"])
    path.write_bytes(spoiled_text(json.dumps(fields), rng))
    found = read_problems(path, vehicle)
    return "question read", "; ".join(answered(each, vehicle, seed) for each in found)


def vehicle_read(folder: Path, seed: int, index: int) -> tuple[str, str]:
    """What became of a spoiled vehicle: an outcome, and what is wrong with it."""
    rng = random.Random(f"vehicle {seed} {index}")
    fields = definition_of(FLEET[rng.choice(list(FLEET))]) | {"name": "spoiled"}
    path = folder / "vehicle.yaml"
    path.write_bytes(spoiled_text(yaml.safe_dump(spoiled(fields, rng)), rng))
    vehicle = read_vehicle(path)
    if vehicle_of(definition_of(vehicle)) != vehicle:
        return "vehicle read", "its definition is of another vehicle"
    asked = [question_of(seed, ASKED * index + each, vehicle) for each in range(ASKED)]
    told = [answered(each, vehicle, seed) for each in asked if each is not None]
    return "vehicle read", "; ".join(filter(None, told))


def tried(folder: Path, seed: int, index: int) -> tuple[str, str]:
    """What became of number ``index``, a question or a vehicle in turn, and what is wrong with that."""
    what = ("question", "vehicle")[index % 2]
    try:
        return (question_read, vehicle_read)[index % 2](folder, seed, index)
    except StorageError as error:
        told = str(error)
        sound = "\n" not in told and 0 < len(told) <= LONGEST
        return f"{what} refused", "" if sound else f"told {told!r}"
    except Exception:
        return f"{what} broke", traceback.format_exc(limit=-3)


def main() -> int:
    """Try so many; 1 if something is wrong with one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=94)
    asked = parser.parse_args()
    outcomes: Counter[str] = Counter()
    wrong = 0
    warnings.simplefilter("error")  # a warning is more lines
    logging.disable(logging.WARNING)  # angles that look like degrees are told of, which is no fault
    with TemporaryDirectory() as folder:
        for index in range(asked.count):
            outcome, told = tried(Path(folder), asked.seed, index)
            outcomes[outcome] += 1
            if told:
                wrong += 1
                print(f"{index}, {outcome}: {told}", flush=True)
    print(", ".join(f"{number:,} {outcome}" for outcome, number in sorted(outcomes.items())))
    print(f"{wrong:,} of {asked.count:,} with something wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
