"""Commands for a run or one of its stages; all take the same options."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

from flows.cli.run_options import Options, worker_count
from flows.cli.terminal import SHORT

if TYPE_CHECKING:
    from tasks.settings.run_settings import RunSettings

NO_OPTIONS: Final = Options()


def run(options: Options = NO_OPTIONS) -> int:
    """Do all stages, draw figures, log to MLflow, and print how much faster planning became."""
    with _session("run", options) as (settings, data):
        from flows.run import run as flow

        flow(settings, data)
    return _exit_code(settings, data)


def collect(options: Options = NO_OPTIONS) -> int:
    """Draw problems, solve them, and keep the most useful plans of each class."""
    with _session("collect", options) as (settings, data):
        from flows.collect import collect as flow

        flow(settings, data)
    return _exit_code(settings, data)


def hallucinate(options: Options = NO_OPTIONS) -> None:
    """Make many problems for each collected plan, all solved by it."""
    with _session("hallucinate", options) as (settings, data):
        from flows.hallucinate import hallucinate as flow

        flow(settings, data)


def train(options: Options = NO_OPTIONS) -> None:
    """Train an encoder for each memory on the hallucinated problems."""
    with _session("train", options) as (settings, data):
        from flows.train import train as flow

        flow(settings, data)


def build_memory(options: Options = NO_OPTIONS) -> None:
    """Join encoder, centroids and plans into one archive for each memory."""
    with _session("build_memory", options) as (settings, data):
        from flows.build_memory import build_memory as flow

        flow(settings, data)


def sweep(options: Options = NO_OPTIONS) -> None:
    """Compare encoder sizes and learning rates on the hallucinated problems."""
    with _session("sweep", options) as (settings, data):
        from flows.sweep import sweep as flow

        flow(settings, data)


def experience_curve(options: Options = NO_OPTIONS) -> None:
    """Make memories of 20, 40 ... 100 % of the experiences, and compare how well they recall."""
    with _session("experience_curve", options) as (settings, data):
        from flows.experience_curve import experience_curve as flow

        flow(settings, data)


def benchmark(options: Options = NO_OPTIONS) -> None:
    """Solve unseen problems with and without memory, and write one row for each attempt."""
    with _session("benchmark", options) as (settings, data):
        from flows.benchmark import benchmark as flow

        flow(settings, data)


def report(options: Options = NO_OPTIONS) -> None:
    """Make tables and figures from the rows of the benchmark."""
    with _session("report", options) as (settings, data):
        from flows.report import report as flow

        flow(settings, data)


def settings_of(options: Options) -> RunSettings:
    """The settings of the options. Raises UsageError if they are not possible."""
    from tasks.settings.presets import for_preset

    settings = for_preset(
        options.preset,
        classes=options.classes,
        worlds=[str(folder) for folder in options.worlds or []],
        difficulty=options.difficulty,
        seed=options.seed,
        objective=options.objective,
        strict=options.strict,
        vehicle=options.vehicle,
        continual=options.continual,
        experiences=options.experiences,
        candidates=options.candidates,
        problems_per_experience=options.problems_per_experience,
        test_problems=options.test_problems,
        epochs=options.epochs,
        learning=options.learning,
        hallucination=options.hallucination,
    )
    if options.learned is None:
        return settings
    from tasks.inputs.gained_on_the_job import with_gained

    return with_gained(settings, options.folder, options.learned)


def _exit_code(settings: RunSettings, data: str) -> int:
    """Return ``SHORT`` and warn again if a class has too few experiences; otherwise return 0."""
    from tasks.inputs.shortfalls import log_shortfalls, shortfalls

    short = shortfalls(data, settings)
    log_shortfalls(short)
    return SHORT if short else 0


@contextmanager
def _session(name: str, options: Options) -> Iterator[tuple[RunSettings, str]]:
    """Set up a command; yields the arguments of the flow ``name``, which may be imported from then on."""
    from tasks.session.command_session import command_session

    settings = settings_of(options)
    workers = worker_count(options.workers)
    with command_session(name, settings, options.folder, workers, options.scheduler) as data:
        yield settings, data
