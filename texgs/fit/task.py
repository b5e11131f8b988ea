"""What the fit of a field of one phase gets, and what it gives."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch

from texgs.fields.field import Field
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


@dataclass(frozen=True, eq=False)
class Fitted:
    """A field, and how its fit went."""

    field: Field
    seconds: float
    iterations: int
    losses: Sequence[float] = ()  # that were looked at
    notes: Mapping[str, Any] = dataclasses.field(
        default_factory=dict
    )  # what else there is to tell: no table reads it
