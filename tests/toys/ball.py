"""A toy of a field: one opaque ball of the views' mean colour. All that a field needs is in one file."""

import json
import time
from dataclasses import dataclass, field, replace
from typing import Any

from texgs.core.keys import key
from texgs.fields.kinds import Kind
from texgs.fitting.kinds import FitSpec


@dataclass
class BallKeys:
    """What is given of the ball."""

    radius: float = key(0.3, "of the ball", "world units", above=0)


@dataclass(frozen=True)
class Ball:
    """The field, and as a scene of one field."""

    radius: float
    color: tuple[float, float, float]
    device: Any = "cpu"
    metadata: dict = field(default_factory=dict)
    kind = "ball"

    def __len__(self):
        return 1

    def to(self, device):
        return replace(self, device=device)

    def tensors(self, role):
        return {}

    @property
    def palettes(self):
        return [(0.0, 0.0, 0.0)]

    def render(
        self, camera, light=None, edits=None, *, look="shaded", background=None, outputs=(), depth_range=None
    ):
        import torch

        from texgs.raster import Render

        if "normal" in outputs or look != "shaded":
            raise AssertionError("asked for what this field has not")
        rows, columns = torch.arange(camera.height) + 0.5, torch.arange(camera.width) + 0.5
        y, x = torch.meshgrid(rows, columns, indexing="ij")
        along = torch.stack([x, y, torch.ones_like(x)], dim=-1) @ camera.K.inverse().T  # z is 1
        rays = along @ camera.viewmat[:3, :3]
        a, b = rays.square().sum(-1), (rays @ camera.position)
        root = b.square() - a * (camera.position.square().sum() - self.radius**2)
        opacity = 1.0 if edits is None else edits[0].opacity * edits[0].visible
        alpha = (root > 0).float() * min(opacity, 1.0)
        depth = torch.where(root > 0, (-b - root.clamp_min(0).sqrt()) / a, 0.0)
        if depth_range is not None:
            alpha = alpha * ((depth >= depth_range[0]) & (depth < depth_range[1]))
        behind = torch.ones(3) if background is None else background
        color = alpha[..., None] * torch.tensor(self.color) + (1 - alpha[..., None]) * behind
        return Render(color, alpha, depth=depth, median=torch.where(alpha > 0.5, depth, 0.0))

    def sizes(self):
        parts = {"geometry_mib": 4 / 2**20, "shading_mib": 12 / 2**20, "texture_mib": 0.0}
        return {**parts, "total_mib": 16 / 2**20, "files_mib": 16 / 2**20}


def read(path):
    """The ball in a file."""
    from safetensors import safe_open

    with safe_open(path, framework="pt") as file:
        values = json.loads(file.metadata()["texgs-ball"])
    return Ball(values["radius"], tuple(values["color"]))


def write(path, ball):
    """Write a ball."""
    import torch
    from safetensors.torch import save_file

    values = json.dumps({"radius": ball.radius, "color": ball.color})
    save_file({"center": torch.zeros(3)}, path, {"texgs-ball": values})
    return path


def compose(fields, segments):
    """Return the only ball."""
    return fields[0]


def fit(task):
    """The mean colour of what is opaque."""
    from texgs.fitting.task import Fitted

    start = time.monotonic()
    planes = task.images.planes.float() / 255
    opaque = planes[:, 3] > 0.5
    color = tuple(float(planes[:, channel][opaque].mean()) for channel in range(3))
    return Fitted(Ball(task.settings.radius, color), time.monotonic() - start, 1, [1.0, 0.5])


FIELD = Kind(
    "ball",
    ("texgs-ball",),
    frozenset({"opacity"}),
    *(f"{__name__}:read", f"{__name__}:write", f"{__name__}:compose"),
)
FIT = FitSpec("ball", "fit a ball", ("ball",), BallKeys, f"{__name__}:fit")
