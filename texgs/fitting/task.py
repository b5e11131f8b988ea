"""Input and output of a fit."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

if TYPE_CHECKING:
    import torch

    from texgs.fields.field import Field
    from texgs.volume.grid import Grid
    from texgs.volume.images import Images
    from texgs.volume.view_set import ViewSet

Settings = TypeVar("Settings")


@dataclass(frozen=True, eq=False)
class FitTask(Generic[Settings]):
    """One field to fit to the views of a basic TF."""

    settings: Settings  # of the kind of field
    views: ViewSet
    images: Images  # the training views, reduced
    output: Path  # folder, also for checkpoints
    device: torch.device
    seed: int
    title: str  # of progress bars
    metadata: Mapping[str, str]  # origin of the field
    volume: Grid | None = None  # volume in the views, if the fit starts from it


@dataclass(frozen=True, eq=False)
class Fitted:
    """A fitted field, with facts about its fit."""

    field: Field
    seconds: float
    iterations: int
    losses: Sequence[float] = ()  # at checked steps
    notes: Mapping[str, Any] = dataclasses.field(default_factory=dict)  # further facts; no table reads them
