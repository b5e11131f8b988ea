"""What a configuration says of views, a file of conf/views, and the cameras, lights and files it comes to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.core.lens import Frame, Lens

if TYPE_CHECKING:
    from texgs.core.camera import Camera
    from texgs.core.light import Light
    from texgs.volume.render import Appearance
    from texgs.volume.view_set import Split, View

LENS = Lens()
LARGEST = 16384  # pixels of a side of a view


@dataclass(frozen=True)
class CameraPath:
    """Where cameras stand around the volume."""

    kind: str = key("icosphere", "arrangement of the cameras", choices=("icosphere", "spiral", "orbit"))
    frequency: int = key(3, "frequency f of the icosphere, which has 10 f^2 + 2 views", least=1)
    count: int = key(61, "number of views of a spiral or orbit", least=1)
    polar: float = key(15.0, "angle of an orbit above the horizon", "degrees", least=-90, most=90)


@dataclass(frozen=True)
class LightKeys:
    """A light: at the camera, from a direction (given as for cameras on the test path), or a random one."""

    kind: str = key("headlight", "kind of light", choices=("headlight", "directional", "random"))
    azimuth: float = key(0.0, "azimuth of a directional light", "degrees")
    polar: float = key(0.0, "polar angle of a directional light", "degrees", least=-90, most=90)


@dataclass(frozen=True)
class Shading:
    """Factors of the Blinn-Phong model; white light."""

    ambient: float = key(0.3, "factor k_a of ambient light", least=0)
    diffuse: float = key(0.7, "factor k_d of diffuse light", least=0)
    specular: float = key(0.3, "factor k_s of highlights", least=0)
    shininess: float = key(20.0, "exponent beta of highlights", least=0)


@dataclass(frozen=True)
class ViewKeys:
    """Training and test views of a volume."""

    name: str = key("views", "name of the folder of the views; a sweep over views has several")
    train: CameraPath = key(CameraPath, "training views")
    test: CameraPath = key(CameraPath, "test views")
    width: int = key("${dataset.image}", "width of views", "pixels", least=1, most=LARGEST)
    height: int = key("${dataset.image}", "height of views", "pixels", least=1, most=LARGEST)
    fov_y: float = key(LENS.fov_y, "vertical field of view", "degrees", above=0, below=180)
    radius: float | None = key(
        None,
        "distance of cameras from the origin, the volume's longest side being 1; default: what all basic TFs "
        "show is centred on 90 % of the smaller side",
        "world units",
        above=0,
    )
    lights: list[LightKeys] = key(
        [LightKeys(), *[LightKeys("random")] * 17],  # light from the side is the hardest to fit
        "training view i is lit by light i modulo their number; a random one is from another direction in "
        "each view, and a headlight where the field that is fitted cannot be relit",
    )
    test_lights: list[LightKeys] = key([LightKeys()], "test view i is lit by light i modulo their number")
    relit: int = key(24, "number of further test views, on a spiral, each under a random light", least=0)
    seed: int = key(0, "seed of random lights", least=0)
    shading: Shading = key(Shading, "material of the volume")
    step: float = key(0.25, "sample distance along rays", "voxels", above=0)
    opacity_unit: float = key(0.005, "length over which a TF's opacity applies", "world units", above=0)
    renderer: str = key(
        "${device.renderer}",
        "what renders the views: the caster, on the CPU or a GPU; or VTK",
        choices=("cpu", "gpu", "vtk"),
    )
    geometry: bool = key(False, "also write depth and normals of the test views, geometry/*.npz")
    turntable: int = key(24, "number of frames of the turntable", least=1)

    def lens(self, frame: Frame | None) -> Lens:
        """Return the common lens of all cameras.

        Args:
            frame: what is visible of the volume; None where views are from elsewhere, as the paper has them.
        """
        size = self.fov_y, self.width, self.height
        if frame and self.radius is None:
            return frame.lens(*size)
        return Lens(self.radius or LENS.radius, *size)


def appearance_of(views: ViewKeys) -> Appearance:
    """Return how the volume looks in views."""
    from texgs.volume.render import Appearance

    return Appearance(**asdict(views.shading), step=views.step, opacity_unit=views.opacity_unit)


def cameras(path: CameraPath, lens: Lens) -> list[Camera]:
    """Return the cameras of one arrangement."""
    from texgs.volume.cameras import icosphere, orbit_path, spiral

    if path.kind == "icosphere":
        return icosphere(path.frequency, lens)
    if path.kind == "spiral":
        return spiral(path.count, lens)
    return orbit_path(path.count, path.polar, lens)


def views_of(views: ViewKeys, lens: Lens, output: Path) -> dict[Split, list[View]]:
    """Return cameras, lights and files of the training and the test views, by split; no split is empty."""
    from texgs.volume.view_set import View

    for name in ("lights", "test_lights"):
        if not getattr(views, name):
            raise ArgumentError(f"views.{name}: expected at least one light, got none")
    splits: dict[Split, tuple[CameraPath, Sequence[LightKeys]]] = {
        "train": (views.train, views.lights),
        "test": (views.test, views.test_lights),
    }
    if views.relit:
        splits["relit"] = CameraPath("spiral", count=views.relit), [LightKeys("random")]
    shots = {}
    for place, (split, (path, lights)) in enumerate(splits.items()):
        placed = cameras(path, lens)
        files = [output / split / f"r_{index:04}.png" for index in range(len(placed))]
        lit = lights_of(lights, len(placed), views.seed, place)
        shots[split] = [View(*each) for each in zip(placed, files, lit, strict=True)]
    return shots


def lights_of(lights: Sequence[LightKeys], count: int, *seed: int) -> list[Light]:
    """Return the lights of so many views, which take turns; random ones are others in each view."""
    from texgs.core.light import Light, random_lights

    turns = [lights[index % len(lights)] for index in range(count)]
    drawn = random_lights(count, *seed)
    return [
        other if light.kind == "random" else Light(**asdict(light))
        for light, other in zip(turns, drawn, strict=True)
    ]
