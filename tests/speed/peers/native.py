"""OMPL in C++ with a checker of its own: compiles ``native.cpp`` once and talks to it line by line."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Self

import numpy as np

from planners.world.arrays import Floats
from planners.world.problem import Problem, start_state
from planners.world.vehicles.vehicle import CAR, Car
from tests.speed.peers.answer import Answer, MissingError, replay
from tests.speed.peers.settings import Kpiece1, Rrt

SOURCE = Path(__file__).with_name("native.cpp")
BUILD = Path(__file__).with_name("build")  # git ignores it
NUMBERS = 10  # that the program has of a car: from its front to its time step
INCLUDES = ("/usr/include", "/usr/local/include")
# Debian's libompl keeps Eigen's alignment of plain x86: what crosses the border must have the same
FLAGS = ("-std=c++17", "-O3", "-march=native", "-DEIGEN_MAX_ALIGN_BYTES=16")


def compile_native() -> Path:
    """The program, compiled now unless it is there already; MissingError without compiler or headers."""
    compiler = shutil.which("g++")
    if compiler is None:
        raise MissingError("OMPL in C++ left out: no g++ here (apt-get install g++).")
    headers = _found("ompl/config.h") + _found("ompl-*/ompl/config.h")
    eigen = _found("eigen3")
    if not headers or not eigen:
        raise MissingError("OMPL in C++ left out: no OMPL headers here (apt-get install libompl-dev).")
    command = [compiler, *FLAGS, f"-I{headers[0].parents[1]}", f"-I{eigen[0]}", str(SOURCE), "-lompl"]
    key = hashlib.sha256(SOURCE.read_bytes() + " ".join(command).encode()).hexdigest()[:16]
    program = BUILD / f"native-{key}"
    if not program.exists():
        BUILD.mkdir(exist_ok=True)
        half_done = program.with_suffix(f".{os.getpid()}")  # others may compile it at the same time
        done = subprocess.run([*command, "-o", str(half_done)], capture_output=True, text=True)
        if done.returncode:
            why = done.stderr.strip().splitlines()[0]
            raise MissingError(f"OMPL in C++ left out: it does not compile ({why}).")
        half_done.rename(program)
    return program


def _found(pattern: str) -> list[Path]:
    return [path for root in INCLUDES for path in Path(root).glob(pattern)]


class Native:
    """The running program; use as a context manager. Problems are sent once, before the clock runs."""

    def __init__(self, vehicle: Car = CAR) -> None:
        self._vehicle = vehicle
        self._numbers: dict[str, int] = {}  # problem id -> its number over there
        self._process = subprocess.Popen(
            [compile_native()], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._ask("car", *vehicle[:NUMBERS])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the program."""
        self._process.communicate()  # closes its stdin, on which it ends

    def kpiece1(self, problem: Problem, seed: int, limit_s: float, settings: Kpiece1) -> Answer:
        """KPIECE1's attempt at a problem."""
        given = {"goal_bias": settings.goal_bias, "border_fraction": settings.border_fraction}
        where = (settings.least_steps, settings.most_steps, settings.cell_m, 0.0)
        return self._plan("kpiece1", problem, seed, limit_s, where, given)

    def rrt(self, problem: Problem, seed: int, limit_s: float, settings: Rrt) -> Answer:
        """RRT's attempt at a problem."""
        given = {"goal_bias": settings.goal_bias, "intermediate_states": int(settings.intermediate)}
        where = (settings.least_steps, settings.most_steps, 1.0, settings.metric)
        return self._plan("rrt", problem, seed, limit_s, where, given)

    def free(self, problem: Problem, states: Floats) -> np.ndarray:
        """Which of ``states [T, 5]`` are free, ``[T]``, by its own checker."""
        answer = self._ask("free", self._number(problem), len(states), *states.ravel().tolist())
        return np.array([mark == "1" for mark in answer])

    def simulate(self, start: Floats, controls: Floats) -> Floats:
        """States ``[T, 5]`` from ``start [5]`` under ``controls [T - 1, 2]``, by its own equations."""
        answer = self._ask("drive", *start.tolist(), len(controls), *controls.ravel().tolist())
        return np.vstack([start, np.array(answer.split(), float).reshape(-1, 5)])

    def _plan(
        self,
        planner: str,
        problem: Problem,
        seed: int,
        limit_s: float,
        where: tuple[float, ...],
        given: dict[str, float],
    ) -> Answer:
        parameters = [word for pair in given.items() for word in pair]
        answer = json.loads(
            self._ask("plan", planner, self._number(problem), seed, limit_s, *where, len(given), *parameters)
        )
        plan = replay(problem, answer["controls"], self._vehicle) if answer["solved"] else None
        return Answer(plan, answer["seconds"], answer["checks"])

    def _number(self, problem: Problem) -> int:
        if problem.id not in self._numbers:
            pieces = problem.obstacles.pieces()
            corners = [word for piece in pieces for word in (len(piece), *piece.ravel().tolist())]
            start, goal = start_state(problem, self._vehicle).tolist(), (*problem.goal, problem.goal_radius)
            self._numbers[problem.id] = int(
                self._ask("problem", *problem.bounds, *start, *goal, len(pieces), *corners)
            )
        return self._numbers[problem.id]

    def _ask(self, *words: object) -> str:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(" ".join(map(str, words)) + "\n")
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            raise RuntimeError(f"The native program ended at {words[0]!r}; its error is above.")
        return answer.strip()
