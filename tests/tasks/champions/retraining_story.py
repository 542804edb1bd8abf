"""A data folder that is retrained again and again, and what was seen on the way, as JSON values."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flows.cli.terminal import notices_shown
from storage.archives.memories import load_memory
from storage.places.data_folder import open_data_folder
from storage.places.files import remove_folder
from tasks.champions import conclude as task
from tasks.champions.dry_run import dry_run
from tasks.champions.promote import promote_awaiting, roll_back
from tasks.fan_out.chunk import run_folder
from tasks.registry.champion_registry import CHALLENGER, Registry, Version
from tasks.registry.model_uris import load_from
from tasks.requests.verify_folder import verify_folder
from tasks.settings.errors import RunError
from tasks.settings.run_settings import RunSettings
from tasks.stages import hallucinate, train
from tasks.stages.hallucinate import HALLUCINATE
from tasks.tracking.model_names import registered_name
from tests.tasks.champions.retrained import CLASS, SETTINGS, learn, retrain
from tests.tasks.in_process import run_stage

NAME = registered_name(CLASS, "car")


class Story:
    """One data folder, and what happens to it."""

    def __init__(self, data: str) -> None:
        self.data = data
        self.seen: dict[str, Any] = {}

    def tell(self, patch: pytest.MonkeyPatch) -> None:
        """All of it, in order."""
        self.first_champion_and_a_better_one()
        self.nothing_new()
        self.nonsense(patch)
        self.taken_over(patch)
        self.rolled_back()
        self.unreachable(patch)
        self.crash_and_approval(patch)
        verify_folder(Path(self.data), 0.05, 1)  # raises where something is wrong

    def first_champion_and_a_better_one(self) -> None:
        (first,) = retrain(self.data)
        learn(self.data, seed=901, count=24)
        (second,) = retrain(self.data)
        self.seen |= {"first": first.to_json(), "second": second.to_json()}
        self.seen["promoted"] = self.state()
        made = load_memory(run_folder(self.data, second).memory(CLASS))
        registered = load_from(self.versions()[1].uri, made.vehicle)
        self.seen["registered as made"] = bool(np.array_equal(registered.masks, made.masks))

    def dry(self) -> str:
        """What a dry run says."""
        return "\n".join(map(str, dry_run(Path(self.data), SETTINGS)))

    def nothing_new(self) -> None:
        self.seen["without news"] = len(retrain(self.data))
        self.seen["dry without news"] = self.dry()
        learn(self.data, seed=902, count=3)
        before = self.listing()
        self.seen["dry with three"] = self.dry()
        self.seen["dry runs wrote"] = self.listing() != before

    def taken_over(self, patch: pytest.MonkeyPatch) -> None:
        third = RunSettings.from_json(self.seen["third"])  # made of nearly the plans of the second
        run = run_folder(self.data, third)

        def again() -> tuple[int, list[bytes]]:
            results = run_stage(HALLUCINATE, self.data, third).values()
            return sum(result.copied_plans for result in results), [
                path.read_bytes() for path in run.shards("hallucinated", CLASS)
            ]

        taken, shards = again()
        with patch.context() as without:
            without.setattr(hallucinate, "problems_of_champion", lambda *_: {})
            anew, same = again()
        self.seen |= {"taken": taken, "taken anew": anew, "anew is the same": shards == same}

    def nonsense(self, patch: pytest.MonkeyPatch) -> None:
        of_memory = train.problems_of_memory

        def shuffled(*asked: Any) -> Any:
            problems = of_memory(*asked)
            order = np.random.default_rng(0).permutation(len(problems.grids))
            return problems._replace(grids=problems.grids[order])

        with patch.context() as without:
            without.setattr(train, "problems_of_memory", shuffled)
            made: list[RunSettings] = []
            self.seen["nonsense said"] = said(lambda: made.extend(retrain(self.data)))
            self.seen["third"] = made[0].to_json()
        self.seen["nonsense"] = self.state()
        self.seen["nonsense again said"] = said(lambda: retrain(self.data))
        self.seen["nonsense again"] = self.state()

    def rolled_back(self) -> None:
        roll_back(Path(self.data), CLASS)
        self.seen["rolled back"] = self.state()
        self.seen["rolled back twice"] = refused(lambda: roll_back(Path(self.data), None))
        self.seen["after rollback"] = len(retrain(self.data))

    def unreachable(self, patch: pytest.MonkeyPatch) -> None:
        learn(self.data, seed=903, count=8)
        with patch.context() as without:
            without.setenv("MLFLOW_TRACKING_URI", "http://127.0.0.1:9")
            without.setenv("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "0")
            self.seen["unreachable said"] = refused(lambda: retrain(self.data))
        self.seen["unreachable"] = self.state()

    def crash_and_approval(self, patch: pytest.MonkeyPatch) -> None:
        """A crash in the last moment before an alias, the champion's run being gone, too; then approval."""
        remove_folder(run_folder(self.data, RunSettings.from_json(self.seen["first"])).path)

        def die(*_: Any) -> None:
            raise KeyboardInterrupt

        with patch.context() as without, contextlib.suppress(KeyboardInterrupt):
            without.setattr(task, "log_judgement", die)
            retrain(self.data, approve=True)
        self.seen["crashed"] = self.state()
        learn(self.data, seed=904, count=3)  # what comes meanwhile waits for the next time
        (made,) = retrain(self.data, approve=True)
        self.seen["awaiting"] = self.state() | {"learned": made.learned}
        promote_awaiting(Path(self.data), CLASS)
        self.seen["approved"] = self.state()
        self.seen["approved twice"] = refused(lambda: promote_awaiting(Path(self.data), None))

    def versions(self) -> list[Version]:
        return Registry(open_data_folder(self.data)).versions(NAME)

    def state(self) -> dict[str, Any]:
        """Who is champion, who awaits approval, and all versions' tags."""
        registry = Registry(open_data_folder(self.data))
        champion, challenger = registry.aliased(NAME), registry.aliased(NAME, CHALLENGER)
        return {
            "champion": champion and champion.number,
            "challenger": challenger and challenger.number,
            "versions": [{**version.tags, "number": version.number} for version in self.versions()],
        }

    def listing(self) -> dict[str, int]:
        """All files but MLflow's own, which it opens to read, too."""
        found = [path for path in Path(self.data).rglob("*") if "mlflow.db" not in path.name]
        return {str(path): path.stat().st_mtime_ns for path in found}


def said(call: Any) -> str:
    """What the command line shows during a call."""
    with contextlib.redirect_stdout(io.StringIO()) as printed, notices_shown():
        call()
    return printed.getvalue()


def refused(call: Any) -> str:
    """The line of the error that a call ends with."""
    with pytest.raises(RunError) as error:
        call()
    return str(error.value)
