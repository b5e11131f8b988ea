"""Transfer functions by name, which plot themselves over the histogram of their volume."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from io import BytesIO
from typing import TYPE_CHECKING

from texgs.core.errors import ArgumentError
from texgs.volume.summaries import Summary
from texgs.volume.transfer import TransferFunction

if TYPE_CHECKING:
    from matplotlib.figure import Figure


AnyFunctions = Mapping[str, TransferFunction] | Sequence[TransferFunction] | TransferFunction


class Functions(dict[str, TransferFunction]):
    """Basic transfer functions of a volume. At the end of a cell they are a picture.

    Args:
        functions: by name.
        channels: summaries of the volume's, by name: histograms are what is behind functions.
    """

    def __init__(self, functions: Mapping[str, TransferFunction], channels: Mapping[str, Summary]) -> None:
        super().__init__(functions)
        self._channels = channels

    def plot(self) -> Figure:
        """Return a figure of matplotlib: opacities and colours over the number of voxels; sizes of labels."""
        from texgs.volume.tf_plot import plot

        return plot({name: asdict(each) for name, each in self._channels.items()}, self)

    def _repr_png_(self) -> bytes:
        """Return the plot, for notebooks."""
        file = BytesIO()
        self.plot().savefig(file, format="png")
        return file.getvalue()


def named(functions: AnyFunctions) -> dict[str, TransferFunction]:
    """Return functions by name: TF01, TF02, ... where they have none."""
    if isinstance(functions, TransferFunction):
        functions = [functions]
    if isinstance(functions, str) or not isinstance(functions, Iterable):
        raise ArgumentError(
            f"functions: expected one texgs.TransferFunction or several, got {functions!r}; name other "
            "arguments, as in recipe='now'"
        )
    if not isinstance(functions, Mapping):
        functions = {f"TF{number:02d}": each for number, each in enumerate(functions, start=1)}
    for name, each in functions.items():
        if not isinstance(name, str):
            raise ArgumentError(f"functions: expected names that are words, got {name!r}; name it in quotes")
        if not isinstance(each, TransferFunction):
            raise ArgumentError(
                f"{name}: expected a texgs.TransferFunction, got {type(each).__name__}; make one "
                "by texgs.TransferFunction(opacity=[(value, opacity), ...], color=[(value, r, g, b), ...])"
            )
    if not functions:
        raise ArgumentError("functions: expected at least one transfer function, got none")
    return dict(functions)
