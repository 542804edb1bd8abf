"""Train encoders for each memory, one per training seed, on all its problems except those held out."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Final, NamedTuple

from planners.memory.encoder.encoder import Architecture, Weights, architecture_of
from planners.memory.encoder.training import Checkpoint, train
from storage.archives.checkpoints import epochs_kept, load_checkpoint, save_checkpoint
from storage.archives.encoders import save_encoder
from storage.archives.memories import load_memory
from storage.places.mirror import remove
from tasks.fan_out.chunk import Chunk, Cut
from tasks.fan_out.stage import Stage, is_marked, mark_done
from tasks.inputs.taught_experiences import taught_masks
from tasks.settings.retraining_settings import champions_of
from tasks.settings.run_settings import RunSettings
from tasks.stages.relabel import labelling_of, problems_of_memory


class Trained(NamedTuple):
    """What an encoder was trained on, and how the training went."""

    problems: int
    plans: int
    epochs: list[dict[str, float]]  # figures of each epoch


def train_chunk(chunk: Chunk) -> Trained:
    """Train one encoder; a training that was interrupted continues after its last epoch.

    A retraining starts from the encoder of the champion if that has the same sizes.
    """
    run_settings = chunk.settings
    problems = problems_of_memory(chunk.data, run_settings, chunk.class_name)
    settings = run_settings.training(run_settings.learning, run_settings.seed + chunk.index)
    path = _checkpoint(chunk)

    def on_epoch(checkpoint: Checkpoint) -> None:
        save_checkpoint(path, checkpoint, chunk.key)

    before = load_checkpoint(path, chunk.key)
    warm = _champion_weights(chunk, settings.architecture)
    masks = taught_masks(chunk.run, run_settings, chunk.class_name)
    given = (problems.grids, problems.plan_index, problems.free, masks)
    trained = train(*given, settings, on_epoch, before, warm)
    folder = _model(chunk)
    save_encoder(folder, trained, chunk.vehicle)
    mark_done(folder, chunk.key)
    remove(path)
    epochs = [epoch._asdict() for epoch in trained.history]
    return Trained(len(problems.plan_index), problems.plans, epochs)


def _champion_weights(chunk: Chunk, architecture: Architecture) -> Weights | None:
    if not champions_of([chunk.class_name], chunk.settings.retraining):
        return None
    weights = load_memory(chunk.run.champion(chunk.class_name), chunk.vehicle).weights
    return weights if architecture_of(weights) == architecture else None


def _model(chunk: Chunk) -> Path:
    return chunk.run.model(chunk.class_name, chunk.index)


def _checkpoint(chunk: Chunk) -> Path:
    return chunk.run.checkpoint(chunk.class_name, chunk.index)


def _cut(data: str, settings: RunSettings, name: str) -> Cut:
    """A chunk for each training seed; its items are epochs."""
    inputs = [
        settings.objective,
        settings.seed,
        asdict(settings.learning),
        *champions_of([name], settings.retraining),
        *labelling_of(name).keys(data, settings, name),
    ]
    return Cut(settings.learning.seeds * settings.epochs, settings.epochs, inputs)


def _class_epochs(chunk: Chunk) -> int:
    """The epochs of a training, times the classes whose problems it has."""
    return (chunk.last - chunk.first) * len(chunk.settings.classes_of(chunk.class_name))


def _class_epochs_done(chunk: Chunk) -> int:
    if TRAIN.is_written(chunk):
        return _class_epochs(chunk)
    return epochs_kept(_checkpoint(chunk), chunk.key) * len(chunk.settings.classes_of(chunk.class_name))


TRAIN: Final = Stage(
    name="train",
    do=train_chunk,
    result=Trained,
    classes=lambda settings: settings.memory_names[::-1],  # the combined one, which takes longest, first
    cut=_cut,
    output=_model,
    is_whole=is_marked,
    unit="epochs of a class",
    units=_class_epochs,
    units_done=_class_epochs_done,
)
