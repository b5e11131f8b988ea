"""What is in a prepared volume: lattice, range and histograms, of each channel; volume.json beside it."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.io import read_json, write_json
from texgs.core.names import mask_name
from texgs.volume.grid import Dims, Triple
from texgs.volume.slabs import Source, slab_bounds
from texgs.volume.space import UNKNOWN_SPACE, Space
from texgs.volume.suggest import looks_like_labels

Counted = dict[str, Any]  # minimum, maximum, histogram, and its scale: "linear" or "log"
Ends = tuple[float, float]

BINS = 256
OUTLIER_DISTANCE = 1.0  # times the range that neighbours share: what is farther out are outliers ...
OUTLIER_SHARE = 1e-3  # ... where they are less of the samples outside the most frequent bin ...
OUTLIER_COUNT = 8  # ... or not more than these
PADDING_GAP = 1 / 8  # of the range, empty above padding
AIR_VALUES = (-1100.0, -900.0)  # Hounsfield units
LOG_RATIO = 1e4  # largest value over the median, from which on logarithms are counted


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
    robust: Counted | None = None  # histogram for suggestions, if different
    space: Space = UNKNOWN_SPACE

    @property
    def voxels(self) -> int:
        """Number of samples."""
        return prod(self.dims)

    @property
    def note(self) -> str:
        """Describe how many samples suggestions ignore, or ""."""
        if not self.robust or not (n_outside := self.voxels - sum(self.robust["histogram"])):
            return ""
        ends = f"[{self.robust['minimum']:g}, {self.robust['maximum']:g}]"
        return f"suggested functions are for {ends}; outliers or padding, left out: {n_outside}"


def summarize(source: Source, minimum: float, maximum: float, shared: Ends = (0.0, 0.0)) -> Summary:
    """Summarize a volume whose range is known, and that which neighbours share; reads it once or more."""
    whole = count_samples(source, minimum, maximum)
    lattice = (source.dims, source.dtype.name, source.spacing, source.origin)
    return Summary(
        *lattice, minimum, maximum, whole["histogram"], robust_histogram(source, whole, shared), source.space
    )


def robust_histogram(source: Source, whole: Counted, shared: Ends) -> Counted | None:
    """Return the histogram for suggestions, or None if it is the whole one.

    A sample is far out of the range that neighbours share only where none beside it is like it. Few of these
    are outliers, as hot pixels are. Far below a CT in air lies padding. Decades are counted by logarithms.
    """
    found, low, high = whole, whole["minimum"], whole["maximum"]
    margin = OUTLIER_DISTANCE * (shared[1] - shared[0])
    fences = max(low, shared[0] - margin), min(high, shared[1] + margin)
    if margin > 0 and fences != (low, high):
        inner = _count_within(source, *fences)
        inside = sum(inner["histogram"])
        most = max(OUTLIER_COUNT, OUTLIER_SHARE * (inside - max(inner["histogram"])))
        if prod(source.dims) - inside <= most:
            found, low, high = inner, inner["minimum"], inner["maximum"]
    first, second = np.flatnonzero(found["histogram"])[:2]
    if low < AIR_VALUES[0] and second - first > PADDING_GAP * BINS:
        rest = _count_within(source, np.nextafter(low, high), high)
        mode = np.linspace(rest["minimum"], high, BINS)[np.argmax(rest["histogram"])]
        found = rest if AIR_VALUES[0] < mode < AIR_VALUES[1] else found
    elif source.dtype.kind == "f" and 0 < low < high / LOG_RATIO:
        logs = count_samples(source, low, high, "log")
        below = int(BINS * (1 - np.log(LOG_RATIO) / np.log(high / low)))
        found = logs if 2 * sum(logs["histogram"][:below]) > prod(source.dims) else found
    is_whole = found is whole or looks_like_labels(np.array(found["histogram"]), high - low)
    return None if is_whole else found


def _count_within(source: Source, low: float, high: float) -> Counted:
    """Count the samples within bounds, over the range that they have."""
    inside = (slab[(slab >= low) & (slab <= high)] for slab in slabs(source))
    ends = [(float(part.min()), float(part.max())) for part in inside if part.size]
    return count_samples(source, min(ends)[0], max(high for _, high in ends))


def count_samples(source: Source, minimum: float, maximum: float, scale: str = "linear") -> Counted:
    """Count samples in equal bins over a range, or over its logarithms ("log"); reads the volume once."""
    to = partial(np.log, dtype=np.float64) if scale == "log" else np.asarray
    with np.errstate(divide="ignore", invalid="ignore"):  # outliers without a logarithm
        ends = float(to(minimum)), float(to(maximum))
        counts = np.sum([histogram(to(slab), *ends) for slab in slabs(source)], axis=0)
    return {"minimum": minimum, "maximum": maximum, "histogram": tuple(counts.tolist()), "scale": scale}


def slabs(source: Source) -> Iterator[np.ndarray]:
    """Yield all samples, slab by slab."""
    return (source.slices(*bounds) for bounds in slab_bounds(source, 0, source.dims[2]))


def histogram(values: np.ndarray, minimum: float, maximum: float) -> np.ndarray:
    """Return counts [256] in equal bins over [minimum, maximum]; the last bin includes its end."""
    if values.dtype.kind in "iu" and values.dtype.itemsize <= 2:
        # Counting every level first is ten times as fast.
        info = np.iinfo(values.dtype)
        counts = np.bincount(values.ravel().astype(np.intp) - info.min, minlength=info.max - info.min + 1)
        levels = np.arange(info.min, info.max + 1)
        return np.histogram(levels, BINS, (minimum, maximum), weights=counts)[0]
    # There may be fewer than 256 numbers of the samples' type in their range, but not in [0, 1].
    fractions = (values.astype(np.float64) - minimum) / (float(maximum) - float(minimum))
    return np.histogram(fractions, BINS, (0, 1))[0]


def summary_file(volume: Path) -> Path:
    """Return the path of the summary beside a prepared volume."""
    return volume.with_suffix(".json")


def write_summaries(volume: Path, summaries: Sequence[Summary], channels: Sequence[str]) -> Path:
    """Write the summaries of a volume.nrrd; those of several channels or masks by name, below the first."""
    said = asdict(summaries[0])
    if len(summaries) > 1 or channels[0].startswith(mask_name("")):
        said["channels"] = dict(zip(channels, map(asdict, summaries), strict=True))
    return write_json(summary_file(volume), said)


def read_summaries(volume: Path) -> dict[str, dict[str, Any]]:
    """Return the summaries of a volume.nrrd by the labels of channels, in their order; of one by ""."""
    said = read_json(summary_file(volume))
    return dict(said["channels"]) if "channels" in said else {"": said}
