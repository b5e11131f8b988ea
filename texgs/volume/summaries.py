"""What is in a prepared volume: lattice, range and histograms, of each channel; volume.json beside it."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import prod
from pathlib import Path
from typing import Any

from texgs.core.io import read_json, write_json
from texgs.volume.grid import Dims, Triple
from texgs.volume.histograms import Ends, Histogram, counted, robust_histogram
from texgs.volume.slabs import Source


@dataclass(frozen=True)
class Summary:
    """Lattice, range and histogram of a prepared volume; plain numbers, ready for JSON."""

    dims: Dims  # x, y, z
    dtype: str
    spacing: Triple
    origin: Triple
    minimum: float
    maximum: float
    histogram: tuple[int, ...]  # counts in 256 equal bins over [minimum, maximum]
    robust: Histogram | None = None  # what functions are suggested from, where that is not all values
    note: str = ""  # for the user

    @property
    def voxels(self) -> int:
        """Number of samples."""
        return prod(self.dims)


def summarize(source: Source, minimum: float, maximum: float, shared: Ends = (0, 0)) -> Summary:
    """Summarize a volume whose range is known, and that which neighbours share; reads it once or few times."""
    whole = counted(source, minimum, maximum)
    robust, note = robust_histogram(source, whole, shared)
    lattice = (source.dims, source.dtype.name, source.spacing, source.origin)
    return Summary(*lattice, minimum, maximum, whole.histogram, robust, note)


def summary_file(volume: Path) -> Path:
    """Return the file beside a prepared volume that says what is in it."""
    return volume.with_suffix(".json")


def write_summaries(volume: Path, summaries: Sequence[Summary], channels: Sequence[str]) -> Path:
    """Write the summaries of a volume.nrrd; those of several channels by their labels, below the first."""
    said = asdict(summaries[0])
    if len(summaries) > 1:
        said["channels"] = dict(zip(channels, map(asdict, summaries), strict=True))
    return write_json(summary_file(volume), said)


def read_summaries(volume: Path) -> dict[str, dict[str, Any]]:
    """Return the summaries of a volume.nrrd by the labels of channels, in their order; of one by ""."""
    said = read_json(summary_file(volume))
    return dict(said["channels"]) if "channels" in said else {"": said}
