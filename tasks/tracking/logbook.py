"""Log the stages of a run in MLflow: parameters, metrics, models, figures and data sets."""

from __future__ import annotations

import logging
import math
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import pandas as pd

from dashboards.statistics.headline import headline_retrieval
from dashboards.verdicts.promotion import Judgement
from storage.places.scratch import scratch_folder
from tasks.attempts.attempt_rows import commit
from tasks.fan_out.chunk import Chunk, run_folder
from tasks.fan_out.keys import key_of
from tasks.settings.run_settings import RunSettings
from tasks.stages.build_memory import Built, figure_names
from tasks.stages.judge import judged_key
from tasks.stages.keep_experiences import experiences_key
from tasks.stages.sweep import swept
from tasks.stages.train import Trained
from tasks.tracking.mlflow_runs import MEMORY_TAG, MODEL_TAG, tracker
from tasks.tracking.model_names import registered_name
from tasks.tracking.parameters import parameters_of

_LOG = logging.getLogger(__name__)


@contextmanager
def run_logged(data: str, settings: RunSettings) -> Iterator[str]:
    """Open the parent run in MLflow while the context lasts, and yield its id.

    It gets the settings as parameters, and tags that say on which machine and from which commit it was made.
    Its stages are child runs; the metrics by which runs are compared are logged on the parent too.

    Args:
        data: the data folder.
        settings: the settings of the run.
    """
    tags = {"commit": commit(), "host": platform.node(), "learned": settings.learned}
    tags |= {name: str(getattr(settings, name)) for name in ("preset", "objective", "difficulty")}
    tags["vehicle"] = settings.vehicle_label
    tags |= {"classes": ", ".join(settings.class_names)}
    log = tracker(data)
    with log.run(settings.run_name, "run", tags) as run_id:
        log.parameters(run_id, parameters_of(settings))
        if page := log.page(run_id):
            _LOG.info("MLflow   %s", page)
        yield run_id


def log_training(data: str, settings: RunSettings, trained: Mapping[Chunk, Trained]) -> None:
    """Log a child run for each trained encoder: parameters, metrics of each epoch, and its training data.

    Args:
        data: the data folder.
        settings: those of the run.
        trained: the results of training, by chunk.
    """
    log, run = tracker(data), run_folder(data, settings)
    for chunk, result in trained.items():
        with child_run(data, settings, _stage(settings, chunk.class_name, chunk.index)) as run_id:
            if log.is_logged(run_id, chunk.key):
                continue
            parameters: dict[str, Any] = parameters_of(settings) | {"class": chunk.class_name}
            parameters |= {"training_seed": settings.seed + chunk.index}
            log.parameters(run_id, parameters | {"problems": result.problems, "plans": result.plans})
            log.metrics(run_id, result.epochs, step="epoch")
            rows = run.table("hallucinated", chunk.class_name)
            log.dataset(run_id, f"hallucinated-{chunk.class_name}", rows, chunk.key, "training")
            log.mark_logged(run_id, chunk.key)


def log_memories(
    data: str, settings: RunSettings, built: Mapping[Chunk, Built], retrieval: pd.DataFrame
) -> None:
    """Log each memory as a model on the child run of its training, with its metrics and curves of recall.

    Args:
        data: the data folder.
        settings: those of the run.
        built: the results of building the memories, by chunk.
        retrieval: the retrieval table of the run, a row for each memory, protocol and recall.
    """
    log, run = tracker(data), run_folder(data, settings)
    for chunk, result in built.items():
        name = chunk.class_name
        with child_run(data, settings, _stage(settings, name, result.training_seed)) as run_id:
            if not log.is_logged(run_id, chunk.key, "memory"):
                model = registered_name(name, settings.vehicle_label)
                model_id = log.memory(run_id, model, run.memory(name), settings.vehicle)
                log.tag(run_id, {MEMORY_TAG: name, MODEL_TAG: model_id})
                for figure in ("retrieval", *figure_names(name)):
                    log.artifacts(run_id, run.figure(figure, "png"), "figures")
                of_memory = retrieval_metrics(retrieval[retrieval["memory"] == name])
                own = f"{name}/memory-{name}/"  # known from the model's name, and MLflow shortens long names
                shown = {metric.removeprefix(own): value for metric, value in of_memory.items()}
                log.metrics(run_id, [shown], model_id=model_id)
                log.mark_logged(run_id, chunk.key, "memory")
    log_headline(data, settings, headline_retrieval(retrieval), ("retrieval",))


def log_headline(
    data: str, settings: RunSettings, metrics: Mapping[str, float], pictures: Sequence[str]
) -> None:
    """Log metrics, pictures and the experiences on the parent run, if there is one."""
    log, run = tracker(data), run_folder(data, settings)
    parent = log.find(settings.run_name, "run")
    if parent is None:
        return
    log.metrics(parent, [metrics])
    for picture in pictures:
        log.artifacts(parent, run.figure(picture, "png"), "figures")
    for name in settings.class_names:
        key = experiences_key(data, settings, name)
        if not log.is_logged(parent, key, f"experiences.{name}"):
            log.dataset(parent, f"experiences-{name}", run.experiences(name), key, "experiences")
            log.mark_logged(parent, key, f"experiences.{name}")


def log_judgement(
    data: str,
    settings: RunSettings,
    memory: str,
    verdict: str,
    judgement: Judgement | None,
    markdown: str,
    attempts: Sequence[pd.DataFrame],
) -> None:
    """Log a child run for a judged memory: the verdict, all numbers, and the attempts that it rests on.

    Args:
        data: the data folder.
        settings: those of the run.
        memory: the name of the memory.
        verdict: the verdict, in the words of the registry.
        judgement: the comparison with the champion; None if there was none.
        markdown: the verdict with its reasons, for people.
        attempts: the attempts of the champion, which are none if there was no champion, and those of the
            challenger.
    """
    log, run = tracker(data), run_folder(data, settings)
    key = key_of(judged_key(data, settings, memory))
    with child_run(data, settings, f"judge {memory}") as run_id:
        log.tag(run_id, {"verdict": verdict, "memory": memory})
        if log.is_logged(run_id, key):
            return
        log.parameters(run_id, parameters_of(settings) | {"memory": memory})
        if judgement is not None:
            log.metrics(run_id, [judgement_metrics(judgement)])
        with scratch_folder() as scratch:
            verdict_file = scratch / "verdict.md"
            verdict_file.write_text(markdown, encoding="utf-8")
            log.artifacts(run_id, verdict_file)
        problems = {str(identity) for rows in attempts for identity in rows["problem_id"].unique()}
        log.metrics(run_id, [{"problems": float(len(problems))}])
        log.dataset(run_id, f"judged-{memory}", run.judged, key, "promotion")
        log.mark_logged(run_id, key)


def judgement_metrics(judgement: Judgement) -> dict[str, float]:
    """The numbers of a ``judgement``, each as a metric with its own name."""
    metrics = {name: float(getattr(judgement, name)) for name in ("sooner_s", "low_s", "high_s")}
    for row in judgement.columns.to_dict("records"):
        prefix = f"{row['panel']}/{row['planner']}/{row['configuration'].replace(' ', '-')}"
        names = (
            "champion_ms", "ms", "reduction", "champion_driving_s", "driving_s", "sooner_s",
            "champion_solved", "solved", "champion_hits", "hits",
        )  # fmt: skip
        metrics |= {f"{prefix}/{name}": float(row[name]) for name in names}
    return metrics


def retrieval_metrics(retrieval: pd.DataFrame) -> dict[str, float]:
    """The numbers of the retrieval table, each as a metric with its own name."""
    metrics: dict[str, float] = {}
    for row in retrieval.to_dict("records"):
        prefix = f"{row['panel']}/memory-{row['memory']}/{row['protocol']}/{row['recall']}"
        numbers = {
            str(name).replace("@", "-"): value for name, value in row.items() if isinstance(value, float)
        }
        metrics |= {f"{prefix}/{name}": value for name, value in numbers.items() if math.isfinite(value)}
    return metrics


def _stage(settings: RunSettings, class_name: str, seed: int) -> str:
    """The name of a training stage, with the seed if there are several."""
    return f"train {class_name}" + (f" seed {seed}" if settings.learning.seeds > 1 else "")


def log_sweep(data: str, settings: RunSettings, chunks: Iterable[Chunk]) -> None:
    """Log a run for the sweep, with a child for each variant: parameters, and metrics of each epoch.

    Args:
        data: the data folder.
        settings: those of the run.
        chunks: the finished chunks of the sweep, one for each variant.
    """
    log = tracker(data)
    with child_run(data, settings, "sweep") as parent:
        for chunk in chunks:
            row, epochs = swept(chunk)
            stage = f"sweep {chunk.class_name} {chunk.index}"
            with log.run(settings.run_name, stage, {}, parent=parent) as run_id:
                if log.is_logged(run_id, chunk.key):
                    continue
                results = ("hit@1", "hit@5", "seconds")
                log.parameters(run_id, {name: value for name, value in row.items() if name not in results})
                log.metrics(run_id, epochs, step="epoch")
                log.metrics(
                    run_id, [{f"of_oracle_{name.replace('@', '_')}": row[name] for name in results[:2]}]
                )
                log.mark_logged(run_id, chunk.key)


@contextmanager
def child_run(data: str, settings: RunSettings, stage: str) -> Iterator[str]:
    """Open the child run of a stage while the context lasts, and yield its id."""
    log = tracker(data)
    with log.run(settings.run_name, stage, {}, parent=log.find(settings.run_name, "run")) as run_id:
        yield run_id
