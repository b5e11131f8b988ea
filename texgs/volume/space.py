"""The space that a file gives places in, such as that of a patient."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Triple = tuple[float, float, float]
# Names are those of NRRD; the first is of files that tell no more.
RIGHT_HANDED, LEFT_HANDED = "3D-right-handed", "3D-left-handed"
LPS, RAS = "left-posterior-superior", "right-anterior-superior"


@dataclass(frozen=True)
class Space:
    """A file's space, and the axes of a lattice in it."""

    name: str = RIGHT_HANDED
    unit: str = ""  # of lengths, such as mm; empty where the file tells none
    axes: tuple[Triple, Triple, Triple] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))  # unit vectors

    @classmethod
    def along(cls, vectors: np.ndarray, name: str = RIGHT_HANDED, unit: str = "") -> Space:
        """Return a space with axes along the rows of vectors [3, 3]; what is not finite tells nothing."""
        if not np.isfinite(vectors).all():
            return cls(name, unit)
        x, y, z = (tuple(row) for row in (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).tolist())
        return cls(name, unit, (x, y, z))

    def place(self, origin: Triple, lengths: Sequence[float]) -> Triple:
        """Return the place at lengths along the axes of the lattice from an origin."""
        x, y, z = (
            first + sum(length * axis[along] for length, axis in zip(lengths, self.axes, strict=True))
            for along, first in enumerate(origin)
        )
        return x, y, z


UNTOLD = Space()


def letters(name: str) -> str:
    """Return to where the axes of a patient's space run, such as LPS; empty for other spaces."""
    return {LPS: "LPS", RAS: "RAS"}.get(name, "")
