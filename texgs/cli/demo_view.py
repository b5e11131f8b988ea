"""One view of the demo: a lamp beside the camera shades the surfels, their textures give the detail."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.cli.demo_scene import DemoScene
from texgs.core.camera import orbit
from texgs.raster import Texture, rasterize
from texgs.raster.shading import blinn_phong_texture

POLAR, RADIUS, FOV_Y = 18.0, 4.1, 36.0  # degrees, world units, degrees
BACKGROUND = (0.055, 0.06, 0.075)
LAMP = (-0.45, -0.65, -1.0)  # direction to the light along the camera's axes: left above
MATERIAL = {"ambient": 0.28, "diffuse": 0.8, "specular": 0.42, "shininess": 40.0}


def view(scene: DemoScene, azimuth: float, size: int) -> Tensor:
    """Render the scene from `azimuth` degrees: colour [size, size, 3]."""
    camera = orbit(azimuth, POLAR, RADIUS, FOV_Y, size, size)
    material = {name: torch.tensor([value]) for name, value in MATERIAL.items()}
    light = camera.viewmat[:3, :3].T @ torch.tensor(LAMP)
    black = torch.zeros_like(scene.means)  # all colour is in the texels
    base, gain = blinn_phong_texture(
        black,
        means=scene.means,
        quats=scene.quats,
        camera_position=camera.position,
        light=light,
        **material,
    )
    render = rasterize(
        scene.means,
        scene.quats,
        scene.scales,
        scene.opacities,
        camera.viewmat,
        camera.K,
        camera.width,
        camera.height,
        texture=Texture(base, gain, scene.texels, scene.sizes, scene.offsets),
        background=torch.tensor(BACKGROUND),
    )
    return render.color
