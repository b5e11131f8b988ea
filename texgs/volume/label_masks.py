"""Labels of a volume as masks: a channel each, softened so that surfaces are smooth, and never false.

Between the numbers of two labels lie those of others, so that labels are not interpolated; their masks are.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import permuted_lattice
from texgs.volume.slabs import Source, slab_bounds
from texgs.volume.space import LPS, RAS, Space
from texgs.volume.transfer import TransferFunction

INSIDE = 255  # of a mask: every sample around has the label
HALF = 127.5  # from here on a place counts as of the label
KERNEL = np.array([1, 4, 6, 4, 1], np.float32) / 16  # close to a Gaussian of one voxel
REACH = len(KERNEL) // 2  # samples
MARGIN = 8  # of a sample to the half: its own label decides on which side it is


class MaskSource(Source):
    """The softened mask of a label [Z, Y, X], uint8: 255 inside, 0 outside, and between them at its surface.

    Softening moves the surface by less than half a voxel: the samples of a label stay inside, all others
    outside, so that nothing thin is lost and nothing grows together. A label without a name has its number.
    """

    def __init__(self, labels: Source, number: int, name: str = "") -> None:
        lattice, called = (labels.spacing, labels.origin), f"label {name or number} of {labels.name}"
        super().__init__(called, labels.dims, np.dtype(np.uint8), *lattice)
        self.label = name or str(number)
        self._labels, self._number, self.space, self.note = labels, number, labels.space, labels.note

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Return samples [stop - start, Y, X]; slices around them are read as well."""
        low, high = max(start - REACH, 0), min(stop + REACH, self.dims[2])
        is_inside = self._labels.slices(low, high) == self._number
        soft = INSIDE * softened(is_inside)[start - low : stop - low]
        own = is_inside[start - low : stop - low]
        sided = np.where(own, np.maximum(soft, HALF + MARGIN), np.minimum(soft, HALF - MARGIN))
        return np.rint(sided).astype(np.uint8)


def softened(mask: np.ndarray) -> np.ndarray:
    """Return a mask [Z, Y, X] after `KERNEL` along each axis, float32; the last samples go on."""
    from scipy.ndimage import correlate1d

    soft = mask.astype(np.float32)
    for axis in range(3):
        soft = correlate1d(soft, KERNEL, axis, mode="nearest")
    return soft


def label_counts(labels: Source, bounds: Sequence[tuple[int, int]] = ()) -> dict[int, int]:
    """Count the samples of each label but 0 within bounds, the largest first; reads them once.

    Raises:
        ArgumentError: if a sample is no whole number.
    """
    counts: Counter[int] = Counter()
    (x0, x1), (y0, y1), (z0, z1) = bounds or [(0, size) for size in labels.dims]
    for slab in slab_bounds(labels, z0, z1):
        numbers, each = np.unique(labels.slices(*slab)[:, y0:y1, x0:x1], return_counts=True)
        if (bad := ~np.isfinite(numbers) | (numbers != np.rint(numbers))).any():
            raise ArgumentError(
                f"{labels.name}: expected labels, which are whole numbers, got {numbers[bad][0]:g}; is it "
                "an image?"
            )
        counts.update(dict(zip(map(int, numbers.tolist()), each.tolist(), strict=True)))
    del counts[0]
    return dict(counts.most_common())


class Flipped(Source):
    """A source in LPS as one in RAS, or the other way: x and y run the other way, and no sample moves."""

    def __init__(self, source: Source, name: str) -> None:
        lattice = source.dims, source.spacing, source.origin, source.space
        dims, spacing, (x, y, z), space = permuted_lattice(*lattice, ((0, -1), (1, -1), (2, 1)))
        super().__init__(source.name, dims, source.dtype, spacing, (-x, -y, z))
        self._source, self.note = source, source.note
        self.space = Space.along(space.axes * (-1, -1, 1), name, space.unit)

    def slices(self, start: int, stop: int) -> np.ndarray:
        """Return samples [stop - start, Y, X]."""
        return self._source.slices(start, stop)[:, ::-1, ::-1]


def on_lattice_of(labels: Source, image: Source) -> Source:
    """Return labels with their axes along those of an image, and require that they lie on its samples."""
    if {labels.space.name, image.space.name} == {LPS, RAS}:
        labels = Flipped(labels, image.space.name)
    is_same = (labels.dims, labels.space.name) == (image.dims, image.space.name)
    moved = np.abs(corners_of(labels) - corners_of(image))
    if not is_same or not (moved <= 0.01 * min(image.spacing)).all():
        raise ArgumentError(
            f"{labels.name}: expected labels on the lattice of {image.name}, {words_of(image)}, got "
            f"{words_of(labels)}; resample them to the image first"
        )
    return labels


def corners_of(source: Source) -> np.ndarray:
    """Return the places [4, 3] of the first sample, and of the last along x, y and z, in the file's space."""
    sides = (np.array(source.dims) - 1) * source.spacing
    return np.array(source.origin) + np.vstack([np.zeros(3), np.diag(sides)]) @ source.space.axes


def words_of(source: Source) -> str:
    """Describe a lattice."""
    size = " x ".join(map(str, source.dims))
    spacing, origin = (", ".join(f"{x:g}" for x in each) for each in (source.spacing, source.origin))
    return f"{size} samples, spacing {spacing}, from {origin} in {source.space.name}"


def shows_label(tf: TransferFunction) -> bool:
    """Return whether a function shows the mask of a label: all values from one half on, where it steps up.

    Those of an image of 8 bits may have the same ends, but begin transparent where there are darker samples.
    """
    (first, step), (last, _) = tf.opacity[0], tf.opacity[-1]
    return (first, last) == (HALF, INSIDE) and step > 0
