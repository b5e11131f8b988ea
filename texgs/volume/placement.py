"""Where the world lies in the space of a volume's file, so that what leaves it can lie there, too."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import AxisPermutation, Grid, closest
from texgs.volume.space import letters

OPPOSITE = str.maketrans("LPSRAI", "RAILPS")


@dataclass(frozen=True)
class Placement:
    """Where the world lies in a file's space."""

    name: str  # as that of a Space
    unit: str
    matrix: list[list[float]]  # [4, 4] from the world to the space

    def __post_init__(self) -> None:
        is_whole = [len(row) for row in self.matrix] == [4] * 4 and self.matrix[3] == [0, 0, 0, 1]
        if not is_whole or not np.linalg.det(self.matrix):
            raise ArgumentError(
                f"matrix: expected 4 rows of 4 numbers that can be inverted, got {self.matrix}"
            )

    @classmethod
    def of(cls, grid: Grid) -> Self:
        """Return that of the world of a grid, which is centred, and whose longest side is 1."""
        middle = grid.space.place(grid.origin, [0.5 * side for side in grid.sides])
        rows = np.column_stack([np.array(grid.space.axes).T / grid.scale, middle]).tolist()
        return cls(grid.space.name, grid.space.unit, [*rows, [0.0, 0.0, 0.0, 1.0]])

    @property
    def scale(self) -> float:
        """Units of the space for one of the world."""
        return float(abs(np.linalg.det(self.matrix)) ** (1 / 3))

    @property
    def turn(self) -> np.ndarray:
        """Where the axes of the world point, [3, 3] in columns: a rotation, or a mirror of one."""
        return np.array(self.matrix)[:3, :3] / self.scale

    @property
    def is_mirrored(self) -> bool:
        """Return whether what is clockwise in the world is not so in the space."""
        return bool(np.linalg.det(self.turn) < 0)

    def points(self, places: np.ndarray) -> np.ndarray:
        """Return places [N, 3] of the world in the space, float64."""
        matrix = np.array(self.matrix)
        return np.asarray(places @ matrix[:3, :3].T + matrix[:3, 3])

    def axis(self, letter: str) -> np.ndarray | None:
        """Return the unit vector [3] of the space towards R, A, S, L, P or I, or along X, Y or Z."""
        ahead, unit = letters(self.name), np.eye(3)
        known = zip("XYZ" + ahead + ahead.translate(OPPOSITE), [*unit, *unit, *-unit], strict=False)
        return dict(known).get(letter)

    @property
    def nearest(self) -> AxisPermutation:
        """The axis of the world that runs most nearly along each of the space, and its sign."""
        return closest(self.turn.T)

    @property
    def drawn(self) -> dict[str, Any]:
        """Return what axes are drawn by: names of the space's own, and at both ends of the world's."""
        ahead, ends = letters(self.name) or "xyz", [["", ""]] * 3
        behind = ahead.translate(OPPOSITE) if letters(self.name) else ["", "", ""]
        for along, (axis, sign) in enumerate(self.nearest):
            ends[axis] = [ahead[along], behind[along]][::sign]
        return {"axes": ahead, "ends": ends, "scale": self.scale}

    def told(self, is_here: bool) -> dict[str, Any]:
        """Return what an export says of the space, and whether its places are there or in the world."""
        matrix = [float(each) for row in self.matrix for each in row]
        return {
            "space": self.name,
            "unit": self.unit,
            "world_to_space": matrix,
            "places": "space" if is_here else "world",
        }
