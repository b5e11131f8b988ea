"""Composed scenes of two kinds of objects, and which surfels are of which: the truth of a segmentation."""

import torch
from torch.nn.functional import normalize

from tests.edit.scenes import on_sphere
from tests.fitting.scenes import logit
from texgs.core.lens import Lens
from texgs.fields.splats import geometry
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.shading import ShadingModel, raw_material
from texgs.raster import rasterize
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import write_scene
from texgs.volume.cameras import icosphere

RED, BLUE = (0.9, 0.1, 0.1), (0.1, 0.2, 0.9)


def shell(n, radius, middle, color, opacity, seed=0):
    """Raw parameters of surfels on a sphere, tangent to it, about as large as the gaps between them."""
    generator = torch.Generator().manual_seed(seed)
    normals = normalize(torch.randn(n, 3, generator=generator), dim=1)
    p = on_sphere(normals, radius, 2.0 * radius / n**0.5, logit(opacity))
    return {**p, "means": p["means"] + torch.tensor(middle), "colors": torch.tensor(color).repeat(n, 1)}


def joined(*parts):
    """One model of stage shading with the surfels of all, and the number [N] of the part of each."""
    together = {name: torch.cat([part[name] for part in parts]) for name in parts[0]}
    numbers = torch.cat([torch.full((len(part["means"]),), i) for i, part in enumerate(parts)])
    return Surfels({**together, **raw_material(0.6, 0.4, 0.05, 20.0, "bounded")}, ShadingModel()), numbers


def two_balls(opacity=0.95, n=1500):
    """A red and a blue ball that hide each other from some sides."""
    red = shell(n, 0.25, (-0.3, 0.0, 0.0), RED, opacity)
    return joined(red, shell(n, 0.25, (0.3, 0.1, 0.1), BLUE, opacity, seed=1))


def write_two_balls(folder):
    """Write scene.yaml, with a model of both balls beside it."""
    file = write_model(folder / "balls.safetensors", two_balls()[0])
    return write_scene(folder / "scene.yaml", Scene({"balls": SceneModel(file)}))


def nested(opacity=0.3, n=2500):
    """A blue ball in a red, semi-transparent shell, and a second blue one beside it that is outside."""
    outer = shell(n, 0.4, (0.0, 0.0, 0.0), RED, opacity)
    inner = shell(n // 2, 0.2, (0.0, 0.0, 0.0), BLUE, 0.6, seed=1)
    return joined(outer, inner, shell(n // 2, 0.15, (0.5, 0.2, 0.1), BLUE, 0.6, seed=2))


def cameras(size=96, frequency=2):
    """All around; 42 of them."""
    return icosphere(frequency, Lens(4.0, 22.0, size, size))


def truth(model, of_class, camera):
    """Mask [H, W] of where a class makes up most of what is seen, and blending weights [N] in that view."""
    lens = (camera.viewmat, camera.K, camera.width, camera.height)
    shown = rasterize(
        *geometry(model.parameters),
        *lens,
        features=of_class.float()[:, None],
        outputs=("statistics",),
        options=model.shading.options,
    )
    mask = (shown.color[..., 0] > 0.5 * shown.alpha) & (shown.alpha > 0.1)
    return mask, shown.statistics.weight_sum


def overlap(mask, expected, weights):
    """Intersection over union by contribution."""
    return float(weights[mask & expected].sum() / weights[mask | expected].sum())
