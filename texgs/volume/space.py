"""The space that a file gives places in, such as that of a patient, and the way there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from texgs.core.errors import ArgumentError

Triple = tuple[float, float, float]
# Names are those of NRRD; the first is of files that tell no more.
RIGHT_HANDED, LEFT_HANDED = "3D-right-handed", "3D-left-handed"
LPS, RAS = "left-posterior-superior", "right-anterior-superior"
OBLIQUE = 30.0  # degrees from the front, so that a side is seen, too
LETTERS = {LPS: ("LPS", "RAI"), RAS: ("RAS", "LPI")}  # ahead and behind along the axes of a patient's space


@dataclass(frozen=True)
class Space:
    """A file's space, and the way there: from lengths along the axes of a lattice, or from the world."""

    name: str = RIGHT_HANDED
    unit: str = ""  # of lengths, such as mm; "" if unknown
    matrix: list[list[float]] = field(default_factory=lambda: np.eye(4).tolist())  # [4, 4]

    def __post_init__(self) -> None:
        is_whole = [len(row) for row in self.matrix] == [4] * 4 and self.matrix[3] == [0, 0, 0, 1]
        if not is_whole or not np.linalg.det(self.matrix):
            raise ArgumentError(
                f"matrix: expected 4 rows of 4 numbers that can be inverted, got {self.matrix}"
            )

    @classmethod
    def along(cls, vectors: np.ndarray, name: str = RIGHT_HANDED, unit: str = "") -> Space:
        """Return a space with axes along the rows of vectors [3, 3]; non-finite ones are ignored."""
        matrix = np.eye(4)
        if np.isfinite(vectors).all():
            matrix[:3, :3] = (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).T
        return cls(name, unit, matrix.tolist())

    @property
    def axes(self) -> np.ndarray:
        """Where the axes of the lattice or the world point, [3, 3] in rows; as long as a unit of these."""
        return np.array(self.matrix)[:3, :3].T

    @property
    def scale(self) -> float:
        """Units of the space for one of the world."""
        return float(abs(np.linalg.det(self.matrix)) ** (1 / 3))

    @property
    def turn(self) -> np.ndarray:
        """Where the axes of the world point, [3, 3] in columns: a rotation, or a mirror of one."""
        return self.axes.T / self.scale

    @property
    def is_mirrored(self) -> bool:
        """Return whether the map from the world to the space changes handedness."""
        return bool(np.linalg.det(self.axes) < 0)

    def points(self, places: np.ndarray) -> np.ndarray:
        """Return places [N, 3] of the world in the space, float64."""
        return np.asarray(places @ self.axes + np.array(self.matrix)[:3, 3])

    def in_world(self, places: np.ndarray) -> np.ndarray:
        """Return places [N, 3] of the space in the world, float64."""
        return np.asarray((places - np.array(self.matrix)[:3, 3]) @ np.linalg.inv(self.axes))

    def place(self, origin: Triple, lengths: Sequence[float]) -> Triple:
        """Return the place at lengths along the axes of the lattice from an origin."""
        x, y, z = (
            first
            + sum(length * axis[along] for length, axis in zip(lengths, self.axes.tolist(), strict=True))
            for along, first in enumerate(origin)
        )
        return x, y, z

    def axis(self, letter: str) -> np.ndarray | None:
        """Return the unit vector [3] of the space towards R, A, S, L, P or I, or along X, Y or Z."""
        ahead, behind = LETTERS.get(self.name, ("", ""))
        unit = np.eye(3)
        return dict(zip("XYZ" + ahead + behind, [*unit, *unit, *-unit], strict=False)).get(letter)

    @property
    def front(self) -> float | None:
        """Azimuth of a camera obliquely in front of a patient, degrees; None without one who is upright."""
        towards = self.axis("A")
        x, _, z = np.zeros(3) if towards is None else self.turn.T @ towards
        return float(np.degrees(np.arctan2(-z, x))) + OBLIQUE if np.hypot(x, z) > 0.5 else None


UNKNOWN_SPACE = Space()
