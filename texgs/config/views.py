"""The schema of conf/views: cameras, lights and the look of the volume in them."""

from dataclasses import dataclass, field

from texgs.core.keys import key
from texgs.core.lens import Lens

LENS = Lens()


@dataclass(frozen=True)
class CameraPath:
    """Where cameras stand around the volume."""

    kind: str = key("icosphere", "arrangement", choices=("icosphere", "spiral", "orbit"))
    frequency: int = key(3, "of the icosphere: 10 f^2 + 2 views", least=1)
    count: int = key(181, "views of a spiral or orbit", least=1)
    polar: float = key(15.0, "angle of an orbit above the horizon", "degrees", least=-90, most=90)


@dataclass(frozen=True)
class LightKeys:
    """A light: at the camera, or from a direction given as for cameras on the test path."""

    kind: str = key("headlight", "kind", choices=("headlight", "directional"))
    azimuth: float = key(0.0, "of a directional light", "degrees")
    polar: float = key(0.0, "of a directional light", "degrees")


@dataclass(frozen=True)
class Shading:
    """Factors of the Blinn-Phong model; white light."""

    ambient: float = key(0.3, "k_a", least=0)
    diffuse: float = key(0.7, "k_d", least=0)
    specular: float = key(0.3, "k_s", least=0)
    shininess: float = key(20.0, "exponent beta", least=0)


@dataclass(frozen=True)
class ViewKeys:
    """Training and test views of a volume."""

    name: str = key("views", "of their folder; a sweep over views has several")
    train: CameraPath = key(CameraPath, "training views")
    test: CameraPath = key(CameraPath, "test views")
    width: int = key("${dataset.image}", "width of views", "pixels", least=1)
    height: int = key("${dataset.image}", "height of views", "pixels", least=1)
    fov_y: float = key(LENS.fov_y, "vertical field of view", "degrees", above=0, below=180)
    radius: float = key(
        LENS.radius, "distance of cameras; the volume's longest side is 1", "world units", above=0
    )
    lights: list[LightKeys] = field(
        default_factory=lambda: [LightKeys()],
        metadata={"help": "view i is lit by light i modulo their number"},
    )
    test_lights: list[LightKeys] = field(
        default_factory=list,
        metadata={"help": "the same for test views; default those of `lights`"},
    )
    shading: Shading = key(Shading, "material of the volume")
    step: float = key(0.25, "sample distance along rays", "voxels", above=0)
    opacity_unit: float = key(0.005, "length over which a TF's opacity applies", "world units", above=0)
    mapper: str = key(
        "${device.mapper}",
        "what renders: the caster, on the CPU or a GPU; or VTK",
        choices=("cpu", "gpu", "vtk"),
    )
    geometry: bool = key(False, "also write depth and normals of the test views, geometry/*.npz")
    turntable: int = key(36, "frames of the turntable", least=1)

    @property
    def lens(self) -> Lens:
        """Of all cameras."""
        return Lens(self.radius, self.fov_y, self.width, self.height)
