"""A run, whole or by one stage: each takes the same options."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from flows.cli.run_options import Options, worker_count

if TYPE_CHECKING:
    from tasks.settings.run_settings import RunSettings

NO_OPTIONS: Final = Options()


def run(options: Options = NO_OPTIONS) -> None:
    """The main job: every stage, figures, MLflow runs, and the table of how much faster planning became."""
    _do("run", options)


def collect(options: Options = NO_OPTIONS) -> None:
    """Draw problems, solve them, and keep the N of each class whose plans are of most use."""
    _do("collect", options)


def hallucinate(options: Options = NO_OPTIONS) -> None:
    """Make many problems that each collected plan solves."""
    _do("hallucinate", options)


def train(options: Options = NO_OPTIONS) -> None:
    """Train an encoder for each memory on the hallucinated problems."""
    _do("train", options)


def build_memory(options: Options = NO_OPTIONS) -> None:
    """Join encoder, centroids and plans into one archive a memory."""
    _do("build_memory", options)


def sweep(options: Options = NO_OPTIONS) -> None:
    """Compare sizes of the encoder and learning rates on the hallucinated problems."""
    _do("sweep", options)


def experience_curve(options: Options = NO_OPTIONS) -> None:
    """Make memories of 20, 40 ... 100 % of the experiences, and compare what they recall."""
    _do("experience_curve", options)


def benchmark(options: Options = NO_OPTIONS) -> None:
    """Solve unseen problems with and without memory: one row an attempt."""
    _do("benchmark", options)


def report(options: Options = NO_OPTIONS) -> None:
    """Tables and figures from the rows of the benchmark."""
    _do("report", options)


def settings_of(options: Options) -> RunSettings:
    """The settings that options ask for, but for what was learned; UsageError where there are none."""
    from tasks.settings.run_settings import for_preset

    return for_preset(
        options.preset,
        classes=options.classes,
        worlds=[str(folder) for folder in options.worlds or []],
        difficulty=options.difficulty,
        seed=options.seed,
        objective=options.objective,
        strict=options.strict,
        vehicle=options.vehicle,
        optimised=options.optimised,
        continual=options.continual,
        experiences=options.experiences,
        candidates=options.candidates,
        problems_per_experience=options.problems_per_experience,
        test_problems=options.test_problems,
        epochs=options.epochs,
        learning=options.learning,
        hallucination=options.hallucination,
    )


def _do(stage: str, options: Options) -> None:
    from tasks.session.command_session import run_stage

    settings = settings_of(options)
    if options.learned is not None:
        from tasks.inputs.learned_on_the_job import with_learned

        settings = with_learned(settings, options.folder, options.learned)
    run_stage(
        f"flows.{stage}",
        stage,
        settings,
        options.folder,
        worker_count(options.workers),
        options.scheduler,
    )
