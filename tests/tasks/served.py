"""A small memory that can be asked, requests for it, and nonsense in their place."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from planners.memory.encoder.encoder import Architecture
from planners.memory.plans.cell_masks import masks_of
from planners.memory.plans.sweeps import sweep_plans
from planners.solve import solve
from planners.world.classes.problem_classes import problem_class
from planners.world.problem import Problem
from storage.archives.memories import save_memory
from storage.exchange.problems import fields_of
from tests.storage.samples import ARCHITECTURE, a_memory

SEED: Final = 901
EASY: Final = problem_class("random", "easy")
JSON: Final = {"Content-Type": "application/json"}

Mutation = Callable[[random.Random, dict[str, Any]], object]


def problem(index: int) -> Problem:
    """A problem of the class that the memory is of."""
    return EASY.draw(SEED, index)


def write_memory(folder: Path, plans: int = 12, architecture: Architecture = ARCHITECTURE) -> Path:
    """Write a memory of some driveable plans; its encoder has learned nothing."""
    found = [solve(problem(i), "follow").plan for i in range(plans)]
    driven = tuple(plan for plan in found if plan is not None)
    sweeps = sweep_plans(driven)
    memory = a_memory(len(driven), architecture=architecture)
    save_memory(folder, replace(memory, plans=driven, sweeps=sweeps, masks=masks_of(sweeps)))
    return folder


def request(*asked: dict[str, Any] | str, **params: Any) -> bytes:
    """The body of a request for some problems: their fields, or texts."""
    texts = [each if isinstance(each, str) else json.dumps(each) for each in asked]
    body: dict[str, Any] = {"dataframe_split": {"columns": ["problem"], "data": [[text] for text in texts]}}
    return json.dumps(body | ({"params": params} if params else {})).encode()


def good_request(index: int = 0) -> bytes:
    """A request for one problem."""
    return request(fields_of(problem(index)))


_ODD: Final = (
    None, True, False, 0, -1, 1e308, -1e308, 1e-320, 10**400, float("nan"), float("inf"), "", "x", "NaN", [],
    {}, [[]], [[[]]], [None], {"a": 1}, "\u0000", "\ud800", [[1, 2]], [[1, 2], [3, 4], [5, 6]], "null",
    [1e308] * 4,
)  # fmt: skip


def _field(rng: random.Random, fields: dict[str, Any]) -> object:
    """A field is of another type."""
    fields[rng.choice([*fields, "groups", "scale", "id", "class"])] = rng.choice(_ODD)
    return request(_text(fields))


def _number(rng: random.Random, fields: dict[str, Any]) -> object:
    """A number deep inside is another."""
    name = rng.choice(["start", "goal", "bounds"])
    fields[name][rng.randrange(len(fields[name]))] = rng.choice(_ODD)
    return request(_text(fields))


def _polygon(rng: random.Random, fields: dict[str, Any]) -> object:
    """A polygon is none."""
    fields["obstacles"].append(
        rng.choice(
            [
                [[0, 0], [50, 50], [0, 50], [50, 0]],
                [[1, 1]] * 5,
                [[rng.uniform(-60, 60), rng.uniform(-60, 60)] for _ in range(rng.randrange(60))],
                [[0, 0], [1e30, 0], [0, 1e30]],
                [[i % 97, i * 31 % 89] for i in range(900)],
                [[i * 0.01, 0] for i in range(5000)],
                rng.choice(_ODD),
            ]
        )
    )
    return request(_text(fields))


def _crowd(rng: random.Random, fields: dict[str, Any]) -> object:
    """Very many obstacles, or such as cover a wide world."""
    wide = rng.choice([57.0, 500.0, 990.0])
    fields["bounds"] = [-7.0, -7.0, wide, wide]
    fields["obstacles"] += [[[10, 20], [wide, 21], [wide, wide], [11, wide]]] * rng.choice([1, 40, 600])
    return request(_text(fields))


def _nested(rng: random.Random, fields: dict[str, Any]) -> object:
    """Brackets without end, outside or in the problem."""
    depth = rng.choice([100, 900, 2_000, 100_000])
    deep = "[" * depth + "]" * depth
    if rng.random() < 0.5:
        return f'{{"dataframe_split": {deep}}}'.encode()
    return request(json.dumps(fields)[:-1] + f', "obstacles": {deep}}}')


def _protocol(rng: random.Random, fields: dict[str, Any]) -> object:
    """The envelope is not what MLflow knows."""
    text = json.dumps(fields)
    odd = rng.choice(_ODD)
    return _text(
        rng.choice(
            [
                odd,
                {"dataframe_split": odd},
                {"dataframe_records": odd},
                {"inputs": odd},
                {"instances": odd},
                {"inputs": {"problem": odd}},
                {"instances": [{"problem": odd}, {"problem": text}]},
                {"dataframe_records": [{"question": text}]},
                {"dataframe_records": [{"problem": text}], "inputs": [text]},
                {"dataframe_split": {"columns": ["problem", "problem"], "data": [[text, text]]}},
                {"dataframe_split": {"columns": ["problem"], "data": [[text, text]]}},
                {"dataframe_split": {"columns": odd, "data": odd, "index": odd}},
                {"dataframe_records": [{"problem": text}], "params": odd},
                {"dataframe_records": [{"problem": text}], "params": {"top_k": odd}},
                {"dataframe_records": [{"problem": text}], "params": {"top_k": 10**18}},
                {"dataframe_records": [{"problem": text}] * 300},
                {"messages": [text]},
                {"prompt": text},
            ]
        )
    ).encode("utf-8", "replace")


def _cut(rng: random.Random, fields: dict[str, Any]) -> object:
    """The text ends early."""
    body = request(fields)
    return body[: rng.randrange(len(body))]


def _bytes(rng: random.Random, fields: dict[str, Any]) -> object:
    """Some bytes are others."""
    body = bytearray(request(fields))
    for _ in range(rng.randrange(1, 9)):
        body[rng.randrange(len(body))] = rng.randrange(256)
    return bytes(body)


def _noise(rng: random.Random, fields: dict[str, Any]) -> object:
    """No text at all."""
    return rng.randbytes(rng.choice([0, 1, 100, 10_000]))


MUTATIONS: Final[tuple[Mutation, ...]] = (
    _field, _number, _polygon, _crowd, _nested, _protocol, _cut, _bytes, _noise,
)  # fmt: skip


def malformed(rng: random.Random) -> tuple[bytes, dict[str, str]]:
    """A body that is mostly no good, and the headers that it comes with; a few are good by chance."""
    body = rng.choice(MUTATIONS)(rng, fields_of(problem(rng.randrange(5))))
    assert isinstance(body, bytes)
    headers = JSON if rng.random() < 0.9 else {"Content-Type": rng.choice(_TYPES)}
    return body, headers


_TYPES: Final = ("text/csv", "application/vnd.apache.parquet", "", "json", "application/json; charset=utf-16")


def _text(value: object) -> str:
    return json.dumps(value)  # with NaN and Infinity, which are no JSON
