"""The schema of conf/views: cameras, lights and the look of the volume in them."""

from dataclasses import dataclass

from texgs.config.dataset import LARGEST
from texgs.core.keys import key
from texgs.core.lens import Frame, Lens

LENS = Lens()


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
        """Return what all cameras have in common.

        Args:
            frame: what is visible of the volume; None where views are from elsewhere, as the paper has them.
        """
        size = self.fov_y, self.width, self.height
        if frame and self.radius is None:
            return frame.lens(*size)
        return Lens(self.radius or LENS.radius, *size)
