"""What a fit of one phase gets, and what it gives."""

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

    settings: Settings  # of the kind
    views: ViewSet
    images: Images  # the training views, reduced
    output: Path  # folder, also for checkpoints
    device: torch.device
    seed: int
    title: str  # of progress bars
    metadata: Mapping[str, str]  # of the field: where it is from
    volume: Grid | None = None  # what the views show, where the fit starts from it


@dataclass(frozen=True, eq=False)
class Fitted:
    """A field, and how its fit went."""

    field: Field
    seconds: float
    iterations: int
    losses: Sequence[float] = ()  # at the steps where they were checked
    notes: Mapping[str, Any] = dataclasses.field(default_factory=dict)  # more to tell, which no table reads
