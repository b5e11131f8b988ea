"""How fields of each kind are fitted: the phases, and of a kind with one phase its settings and function.

A fit is one module of this package, which defines FIT; or the module of a kind in `texgs.fields.kinds` does.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from texgs.core.specifications import specifications
from texgs.fields import kinds as fields
from texgs.fields.kinds import Kind

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
    volume: Grid | None = None  # that the views show, where the fit starts from it


@dataclass(frozen=True, eq=False)
class Fitted:
    """A field, and how its fit went."""

    field: Field
    seconds: float
    iterations: int
    losses: Sequence[float] = ()  # at the steps where they were checked
    notes: Mapping[str, Any] = dataclasses.field(default_factory=dict)  # more to tell, which no table reads


@dataclass(frozen=True)
class FitSpec(Generic[Settings]):
    """How fields of one kind are fitted. Its module imports nothing heavy before `fit` is called."""

    field: Kind
    summary: str  # what the fit does, in `texgs --help`
    phases: tuple[str, ...]  # stages in their order; the last makes what scenes are composed of
    settings: type[Settings] | None = None  # of the keys `fit.NAME`; None for surfels, whose keys are `fit`
    fit: Callable[[FitTask[Settings]], Fitted] | None = None  # None for surfels: each phase is a stage
    check: Callable[[Settings], None] = lambda settings: None  # that they fit each other
    devices: frozenset[str] = frozenset({"cpu", "cuda"})  # where it can be fitted

    @property
    def name(self) -> str:
        """The kind of field."""
        return self.field.name

    @property
    def module(self) -> str:
        """The module whose code fits the field."""
        return self.fit.__module__ if self.fit else self.field.module


def fit_specs() -> dict[str, FitSpec[Any]]:
    """Return how each kind of field is fitted, by name."""
    found = {**specifications(fields.__name__, "FIT"), **specifications(__name__, "FIT")}
    return dict(sorted(found.items()))
