"""SPZ files of Niantic, version 3: rounded splats of about 30 bytes each, compressed by gzip."""

import gzip
from collections.abc import Sequence
from math import frexp
from pathlib import Path
from struct import pack

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import write_bytes
from texgs.raster.shading import DEGREES
from texgs.scene.clouds import Cloud

VERSION, ANTIALIASED = 3, 1  # of the format, and a flag
COORDINATE_BITS = 22  # of 24 bits; one is the sign, one is spare for rounding
COLOR_SCALE = 0.15  # of the constant harmonic; leaves room for colours slightly outside of [0, 1]


def write_spz(path: str | Path, clouds: Sequence[Cloud]) -> Path:
    """Create or replace an .spz file in one step; it has all models as one, without their names.

    Axes are those of texgs (right, up, back). Source: load-spz.cc of github.com/nianticlabs/spz.

    Raises:
        ArgumentError: if splats are too far away for coordinates of 24 bits, or the file cannot be written.
    """
    count = max(cloud.sh.shape[1] for cloud in clouds)
    padded = [np.pad(each.sh, ((0, 0), (0, count - each.sh.shape[1]), (0, 0))) for each in clouds]
    values = [(each.means, each.opacities, each.scales, each.quats) for each in clouds]
    means, opacities, scales, quats, sh = map(np.concatenate, (*zip(*values, strict=True), padded))
    farthest = float(np.abs(means).max())
    fraction = COORDINATE_BITS - max(frexp(farthest)[1], 0)
    if fraction < 0:
        raise ArgumentError(
            f"{path}: expected splats within 2^{COORDINATE_BITS} of the origin, got {farthest:g}"
        )
    flags = ANTIALIASED * all(each.antialiased for each in clouds)
    header = pack("<4sIIBBBB", b"NGSP", VERSION, len(means), DEGREES[count], fraction, flags, 0)
    coordinates = np.round(means.astype(np.float64) * 2**fraction).astype("<i4")
    columns = (
        coordinates[..., None].view(np.uint8)[..., :3],
        _bytes(255 * opacities),
        _bytes(255 * (0.5 + COLOR_SCALE * sh[:, 0])),
        _bytes(16 * (np.log(scales) + 10)),
        _rotations(np.roll(quats, -1, axis=1)),
        _bytes(128 + 128 * sh[:, 1:]),
    )
    return write_bytes(path, gzip.compress(header + b"".join(x.tobytes() for x in columns), mtime=0))


def _bytes(values: np.ndarray) -> np.ndarray:
    return np.round(values).clip(0, 255).astype(np.uint8)


def _rotations(quats: np.ndarray) -> np.ndarray:
    """Pack quaternions [N, 4] xyzw into 32 bits each [N].

    From the top: which is the largest, in 2 bits, and of the others signs and 9 bits, as if it were positive.
    """
    largest = np.abs(quats).argmax(axis=1)[:, None]
    positive = np.where(np.take_along_axis(quats, largest, axis=1) < 0, -quats, quats)
    three = positive[np.arange(4) != largest].reshape(-1, 3)
    small = np.round(511 * 2**0.5 * np.abs(three)).clip(0, 511).astype("<u4") | (three < 0) * np.uint32(512)
    return (largest[:, 0].astype("<u4") << 30) | small[:, 0] << 20 | small[:, 1] << 10 | small[:, 2]
