"""How encoders are trained, beyond objective and epochs: part of a run's settings."""

from __future__ import annotations

from dataclasses import dataclass

from planners.memory.encoder.encoder import Architecture
from planners.memory.encoder.training import TrainingSettings

_DEFAULT = TrainingSettings()


@dataclass(frozen=True)
class Learning:
    """The fields of ``TrainingSettings`` that a user can choose, and the number of training seeds."""

    seeds: int = 1  # encoders trained for a memory; the best on validation problems is kept
    patience: int = _DEFAULT.patience
    learning_rate: float = _DEFAULT.learning_rate
    origin_weight: float = _DEFAULT.origin_weight
    margin: float = _DEFAULT.margin
    semi_hard: bool = _DEFAULT.semi_hard
    own_anchors: bool = _DEFAULT.own_anchors
    batch: int = _DEFAULT.batch
    weight_decay: float = _DEFAULT.weight_decay
    network: str = _DEFAULT.architecture.network
    channels: tuple[int, ...] = _DEFAULT.architecture.channels
    hidden: tuple[int, ...] = _DEFAULT.architecture.hidden
    dimensions: int = _DEFAULT.architecture.dimensions

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", tuple(self.channels))  # lists when they come from JSON
        object.__setattr__(self, "hidden", tuple(self.hidden))
        if self.seeds < 1:
            raise ValueError(f"{self.seeds} training seeds: give 1 or more.")
        self.settings(_DEFAULT.objective, 1, 0)

    def settings(self, objective: str, epochs: int, seed: int) -> TrainingSettings:
        """All settings of one training; ValueError with one line if they are impossible."""
        return TrainingSettings(
            objective=objective,
            epochs=epochs,
            patience=self.patience,
            learning_rate=self.learning_rate,
            origin_weight=self.origin_weight,
            margin=self.margin,
            semi_hard=self.semi_hard,
            own_anchors=self.own_anchors,
            batch=self.batch,
            weight_decay=self.weight_decay,
            architecture=Architecture(self.channels, self.hidden, self.dimensions, self.network),
            seed=seed,
        )
