"""A field of small networks with palette colours, or free colours after an edit (StyleRF-VolVis).

Unlike the authors' (Tang et al. 2024), it fills the box around the object instead of a fixed cube, all shares
of the palette mix where theirs keep the largest alone, and weights are as fitted, without a running mean.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import inf
from pathlib import Path
from typing import Any, ClassVar, Self

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError, DeviceError, ShapeError, errors_at
from texgs.core.io import reading_as
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.fields.field import Asked, Role, UnlitField, UnlitScene, require_depth, sizes_in_mib
from texgs.fields.palette.networks import Parameters, free_color, light, network_shapes, palette_color
from texgs.fields.palette.rendering import (
    RAYS,
    DensePoints,
    Geometry,
    merge_points,
    points_on,
    view_harmonics,
    visible_points,
)
from texgs.fields.voxels import grid_of, lattice, march_of
from texgs.raster import Render
from texgs.raster.hash_encoding import HashLevels
from texgs.raster.voxels import camera_rays

MIN_WEIGHT = 1e-4  # least weight of a point whose colour is evaluated
OCCUPANCY_SIDE = 128  # points along each side of the authors' two lattices
FORMAT = "texgs-palette"
VERSION = 1
GRID_TENSORS = ("masks", "density")  # tensors of the grid


@dataclass(frozen=True, eq=False)
class PaletteField(UnlitField):
    """Networks on the CPU with baked light."""

    kind: ClassVar[str] = "palette"

    geometry: Geometry
    parameters: Parameters
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        """Return the number of rows of all hash grids."""
        return sum(len(x) for name, x in self.parameters.items() if name.endswith(".table"))

    @property
    def device(self) -> torch.device:
        """Always the CPU."""
        return self.parameters["palette.colors"].device

    @property
    def colors(self) -> Tensor:
        """The palette, [P, 3]."""
        return self.parameters["palette.colors"]

    def to(self, device: torch.device | str) -> Self:
        """Return the field itself; it renders on the CPU only."""
        if torch.device(device).type != "cpu":
            raise DeviceError(f"device: expected cpu, got {device}; palette fields are rendered on the CPU")
        return self

    def tensors(self, role: Role) -> dict[str, Tensor]:
        """Return raw parameters by network and layer; geometry includes the grid's densities."""
        placed = {name: x for name, x in self.parameters.items() if name.startswith("density.")}
        if role == "geometry":
            return {"grid": self.geometry.grid.rows, **placed}
        return {name: x for name, x in self.parameters.items() if name not in placed}

    def color(self, points: DensePoints, harmonics: Tensor) -> Tensor:
        """Return lit colours [n, 3] of points: free colours if there are any, otherwise palette colours.

        `harmonics` [n, 16] are those of the directions of their rays.
        """
        parameters, levels = self.parameters, self.geometry.levels
        lit = light(points.features, harmonics, parameters)
        if "free.table" in parameters:
            return free_color(points.at, parameters, levels) + lit
        return palette_color(points.at, parameters, levels).color + lit

    def draw(self, camera: Camera, background: Tensor | None, outputs: Collection[str]) -> Render:
        """Render the field."""
        return PaletteScene([self]).render(camera, background=background, outputs=outputs)

    def sizes(self) -> dict[str, float]:
        """Return sizes in MiB.

        The paper counts the hash grids and two lattices of 32 bits for what is occupied; the file has all
        networks, and a mask for each block of voxels and a number for each voxel.
        """
        grid, groups = self.geometry.grid, {"density": "geometry", "free": "texture"}
        counted = {"geometry": 2 * 4 * OCCUPANCY_SIDE**3, "shading": 0, "texture": 0}
        stored = {"geometry": 8 * grid.masks.numel() + 4 * len(grid.rows), "shading": 0, "texture": 0}
        for name, x in self.parameters.items():
            group = groups.get(name.split(".")[0], "shading")
            counted[group] += 4 * x.numel() if name.endswith(".table") else 0
            stored[group] += 4 * x.numel()
        return sizes_in_mib(counted, stored)


class PaletteScene(UnlitScene[PaletteField]):
    """Several fields in one scene, see `UnlitScene`; densities add up, opacity is a factor on them."""

    def _blend(self, factors: Sequence[float], camera: Camera, asked: Asked) -> Render:
        background, outputs, depth_range = asked
        require_depth(outputs, "palette fields")
        rays = camera_rays(camera).flatten(0, 1)
        near, far = (
            torch.tensor([[0.0], [inf]]).expand(2, len(rays))
            if depth_range is None
            else depth_range.flatten(1)
        )
        parts = zip(*(x.split(RAYS) for x in (rays, near, far)), strict=True)
        blended = torch.cat([self._sums(factors, *part) for part in parts])  # [N, 5]
        color, alpha, depth = blended.split([3, 1, 1], dim=1)
        behind = torch.ones(3) if background is None else background
        color = (color + (1 - alpha) * behind).clamp(0, 1)
        size = (camera.height, camera.width)
        depth = (depth / alpha.clamp_min(1e-12)).reshape(size) if outputs else None
        return Render(color.reshape(*size, 3), alpha.reshape(size), depth=depth)

    def _sums(self, factors: Sequence[float], rays: Tensor, near: Tensor, far: Tensor) -> Tensor:
        """Return sums [N, 5] over parts of rays [N, 6] of weight times colour, 1 and distance."""
        several = []
        for each, factor in zip(self.fields, factors, strict=True):
            points = points_on(rays, each.geometry, each.parameters)
            points = points.take((points.distance >= near[points.ray]) & (points.distance < far[points.ray]))
            several.append(points._replace(depth=factor * points.depth))
        points, owner = merge_points(several)
        shows = visible_points(points, MIN_WEIGHT)
        owner, harmonics = owner[shows.chosen], view_harmonics(rays)
        values = torch.ones(len(owner), 5)
        values[:, 4] = shows.points.distance
        for index, each in enumerate(self.fields):
            own = owner == index
            own_points = shows.points.take(own)
            values[own, :3] = each.color(own_points, harmonics[own_points.ray])
        return shows.blend(values, len(rays))


def write_palette(path: str | Path, field: PaletteField) -> Path:
    """Create or replace a file of a palette field in one step; its metadata must be JSON."""
    geometry = field.geometry
    networks = {name: x.detach().contiguous() for name, x in field.parameters.items()}
    check.finite(**networks)
    description = {
        "version": VERSION,
        **lattice(geometry.grid, geometry.march),
        "hash": asdict(geometry.levels),
        "metadata": dict(field.metadata),
    }
    grid = {"masks": geometry.grid.masks, "density": geometry.grid.density}
    return write_tensor_file(path, FORMAT, description, {**grid, **networks})


def read_palette(path: str | Path) -> PaletteField:
    """Read a file of `write_palette` bit for bit. Nothing in it is executed."""
    description, tensors = read_tensor_file(Path(path), FORMAT, VERSION)
    with errors_at(path), reading_as("networks and a grid", "write it again"):
        networks = {name: x for name, x in tensors.items() if name not in GRID_TENSORS}
        check.finite(density=tensors["density"], **networks)
        geometry = _geometry(tensors, description)
        _check_networks(networks, geometry.levels)
        return PaletteField(geometry, networks, dict(description["metadata"]))


def _geometry(tensors: Mapping[str, Tensor], description: Mapping[str, Any]) -> Geometry:
    grey = torch.zeros(len(tensors["density"]), 1, 3)
    grid = grid_of({**tensors, "sh": grey}, description)
    return Geometry(grid, march_of(description), HashLevels(**description["hash"]))


def _check_networks(networks: Mapping[str, Tensor], levels: HashLevels) -> None:
    """Require all networks in the right shapes; free colours are optional."""
    colors = check.shape("palette.colors", networks["palette.colors"], "P 3")["P"]
    absent = {"base"} if any(name.startswith("free.") for name in networks) else {"base", "free"}
    shapes = {
        name: shape
        for name, shape in network_shapes(levels, colors).items()
        if name.split(".")[0] not in absent
    }
    if unknown := sorted(set(networks) ^ set(shapes)):
        raise ArgumentError(f"{unknown[0]}: expected the networks of a palette field, got others")
    for name, shape in shapes.items():
        check.floating(name, networks[name])
        if tuple(networks[name].shape) != shape:
            raise ShapeError(f"{name}: expected {list(shape)}, got {list(networks[name].shape)}")
