"""Small networks whose colours are mixtures of a palette: what StyleRF-VolVis builds on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.config.fields import Kind
from texgs.config.palette_fit import PaletteKeys
from texgs.core.errors import DeviceError

if TYPE_CHECKING:
    from torch import Tensor

    from texgs.fields.palette.composition import PaletteScene
    from texgs.fields.palette.model import PaletteField
    from texgs.fit.task import FitTask, Fitted


def read(path: Path) -> PaletteField:
    """The field in a file."""
    from texgs.fields.palette.file import read_palette

    return read_palette(path)


def write(path: Path, field: PaletteField) -> Path:
    """Write a field without loss."""
    from texgs.fields.palette.file import write_palette

    return write_palette(path, field)


def compose(fields: Sequence[PaletteField], segments: Sequence[Sequence[Tensor]]) -> PaletteScene:
    """Fields as one scene."""
    from texgs.fields.palette.composition import PaletteScene

    return PaletteScene(fields)


def fit(task: FitTask[PaletteKeys]) -> Fitted:
    """Fit networks to random rays, from the last checkpoint if there is one.

    Raises:
        DeviceError: for another device than the CPU.
    """
    from texgs.fit import checkpoint
    from texgs.fit.palette import PaletteFit
    from texgs.fit.resumable import run_to_end
    from texgs.fit.task import Fitted

    if task.device.type != "cpu":
        raise DeviceError(f"device: expected cpu, got {task.device}; palette fields are fitted on the CPU")
    run = PaletteFit(task.images, task.settings, task.seed)
    seconds = run_to_end(run, task.output / checkpoint.FOLDER, task.title)
    field = run.field(task.metadata)
    return Fitted(field, seconds, run.iterations, run.losses, {"palette": field.colors.tolist()})


FIELD = Kind(
    "palette",
    "fit networks with palette colours",
    ("texgs-palette",),
    frozenset({"opacity"}),
    read,
    write,
    compose,
    phases=("palette",),
    settings=PaletteKeys,
    fit=fit,
    check=PaletteKeys.check,
    exports=("mesh",),
    depth="depth",  # the mean
    film_size=128,
    devices=frozenset({"cpu"}),
)
