"""Rows as the storage gives them, made up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from storage.tables.configurations import BASELINE, Configuration

STANDARD = [
    BASELINE,
    *(Configuration(assist, "encoder", k) for assist in ("closed", "open") for k in (1, 5)),
    *(Configuration(assist, "exhaustive", 5) for assist in ("closed", "open", "repair")),
    Configuration("fresh", "", 0),
]
CLOSED_1 = STANDARD[1]
POLISHED = [each._replace(polished=True) for each in (BASELINE, STANDARD[-2])]
ABLATION = [Configuration("random-open", "random", 1), Configuration("random-open", "random", 5)]
PARTS = ("occupancy", "encode", "recall", "scene", "check", "guide", "repair", "roadmap", "search")


def attempts(
    classes: tuple[str, ...] = ("curves", "random", "trap"),
    planners: tuple[str, ...] = ("rrt", "gust", "follow"),
    configurations: Sequence[Configuration] = STANDARD,
    problems: int = 40,
    speed_up: float = 4.0,
    seed: int = 0,
    memory: str | None = None,
) -> pd.DataFrame:
    """Attempt rows in which memory makes planning ``speed_up`` times as fast, with noise."""
    rng = np.random.default_rng(seed)
    rows: list[dict[str, Any]] = []
    for name, planner in product(classes, planners):
        hardness = rng.lognormal(0.0, 1.0, problems)
        for (assist, recall, top_k, polished), i in product(configurations, range(problems)):
            seconds = 1e-3 * hardness[i] * rng.lognormal(0.0, 0.3) / (1.0 if assist == "none" else speed_up)
            solved = bool(rng.random() < 0.95)
            recalled = assist not in ("none", "fresh") and rng.random() < 0.5
            parts = 0.9 * seconds * rng.dirichlet(np.ones(len(PARTS)))
            rows.append(
                {
                    "problem_id": f"{name}-{i}",
                    "problem_class": name,
                    "planner": planner,
                    "assist": assist,
                    "top_k": top_k,
                    "recall": recall or None,
                    "polished": polished,
                    "memory": None if assist in ("none", "fresh") else memory or name,
                    "status": "solved" if solved else "budget-spent",
                    "solved": solved,
                    "source": ("recalled" if recalled else "searched") if solved else None,
                    "hit": None,
                    "planning_seconds": seconds,
                    **{f"{part}_seconds": share for part, share in zip(PARTS, parts, strict=True)},
                    "collision_checks": int(1e6 * seconds),
                    "expansions": int(1e5 * seconds),
                    "duration_s": 20.0 + rng.random() - (0.5 if recalled else 0.0) if solved else None,
                }
            )
    return pd.DataFrame(rows)


def meant(row: Mapping[Any, Any]) -> Configuration:
    """The configuration of an attempt row."""
    recall = row["recall"] if isinstance(row["recall"], str) else ""
    return Configuration(row["assist"], recall, row["top_k"], bool(row["polished"]))


def recalls(
    classes: tuple[str, ...] = ("curves", "random", "trap"),
    problems: int = 60,
    plans: int = 30,
    protocols: tuple[str, ...] = ("held-out", "fresh"),
    seed: int = 0,
    seeds: int = 2,
) -> pd.DataFrame:
    """Recall rows of rankings better than chance."""
    rng = np.random.default_rng(seed)
    rows: list[dict[str, Any]] = []
    ways = [("popularity", 0), *(("encoder", training_seed) for training_seed in range(seeds))]
    for name, protocol, (recall, training_seed), i in product(classes, protocols, ways, range(problems)):
        free = rng.random(plans) < 0.1
        held_out = protocol == "held-out" and free.any()
        score = free + rng.normal(size=plans)
        rows.append(
            {
                "problem_id": f"{name}-{i}",
                "class": name,
                "memory": name,
                "protocol": protocol,
                "order": np.argsort(-score).astype(np.int32),
                "free": free,
                "nothing_recalled": bool(rng.random() < 0.1),
                "recall": recall,
                "training_seed": training_seed,
                "made_for": int(rng.choice(np.flatnonzero(free))) if held_out else -1,
            }
        )
    return pd.DataFrame(rows)
