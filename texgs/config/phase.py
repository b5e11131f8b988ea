"""Settings of the phases of a fit, and of where it starts. Kinds of field build on them."""

from collections.abc import Mapping
from dataclasses import dataclass

from texgs.core.errors import ArgumentError
from texgs.core.keys import key


@dataclass
class CommonRates:
    """Learning rates of Adam at the start of a phase, of surfels and of 3D Gaussians."""

    means: float = key(1.6e-4, "of means, times the extent of the cameras", "world units", least=0)
    quats: float = key(0.004, "of quaternions", least=0)
    scales: float = key(0.02, "of the logarithm of scales", least=0)
    opacities: float = key(0.2, "of the logit of opacities", least=0)
    sh: float = key(0.01, "of the zeroth spherical harmonic", least=0)
    sh_rest: float = key(0.0005, "of the other spherical harmonics", least=0)
    means_final: float = key(0.01, "rate of means at the end, relative to the start", least=0)
    final: float = key(0.05, "the other rates at the end, relative to the start", least=0)


@dataclass
class Rates(CommonRates):
    """Learning rates of Adam at the start of a phase."""

    colors: float = key(0.01, "of surfel colours", least=0)
    material: float = key(0.02, "of raw ambient, diffuse, specular and shininess", least=0)


@dataclass
class Losses:
    """Weights of the losses."""

    dssim: float = key(0.2, "lambda of D-SSIM against L1, of colour and of alpha", least=0)
    alpha: float = key(0.1, "of L1 + D-SSIM of alpha", least=0)
    alpha_l1: bool = key(True, "alpha's L1 has a gradient; in the release only its D-SSIM has")
    normal: float = key(0.0, "of normal consistency", least=0)
    normal_from: int = key(0, "iteration from which normals count", least=0)
    smoothness: float = key(0.0, "of bilateral smoothness, of each map of a per-surfel material", least=0)


@dataclass
class Densify:
    """Adaptive density control."""

    start: int = key(100, "first iteration", least=0)
    stop: int = key(1300, "last iteration", least=0)
    every: int = key(50, "iterations between steps", least=1)
    threshold: float = key(
        2e-4, "mean screen-space gradient, half image widths, that clones or splits", least=0
    )
    size: float = key(0.01, "scale, in extents, above which one is split, not cloned", least=0)
    cap: int = key(30000, "surfels or Gaussians at most", least=1)
    prune_opacity: float = key(0.005, "what has less opacity is removed", least=0)
    prune_size: float = key(0.1, "what has a larger scale, in extents, is removed", least=0)
    reset_every: int = key(0, "iterations between opacity resets; 0: never", least=0)


@dataclass
class Phase:
    """One run of the loop."""

    iterations: int = key(0, "views, one each", least=0)
    sh_degree: int = key(3, "of spherical harmonics, in the phase without shading", least=0)
    sh_every: int = key(1000, "iterations between degrees", least=1)
    turns_normals: bool = key(True, "shading has gradients into normals; in the release it has none")
    rates: Rates = key(Rates, "learning rates")
    losses: Losses = key(Losses, "weights")
    densify: Densify = key(Densify, "density control")


SEEDS = ("auto", "points", "visible", "voxels", "hull", "random")


@dataclass
class Seeds:
    """Where surfels or Gaussians start."""

    kind: str = key("auto", "auto: points of the views if there are any, else visible", choices=SEEDS)
    count: int = key(10000, "at the start; given points are taken as they are", least=1)
    opacity: float = key(0.1, "of each", least=0)
    half_size: float | None = key(
        None,
        "half the side of the cube, in halves of the data's longest side; default the box of the data",
        above=0,
    )


@dataclass
class Material:
    """Blinn-Phong factors that the shading phase starts with."""

    ambient: float = key(0.5, "k_a", least=0)
    diffuse: float = key(0.5, "k_d", least=0)
    specular: float = key(0.1, "k_s", least=0)
    shininess: float = key(20.0, "beta", least=0)


RANGES = {  # that factors can be in, by the range of materials, see `fit.material_range`; others have none
    "bounded": {
        "ambient": (0.0, 1.0),
        "diffuse": (0.0, 1.0),
        "specular": (0.0, 1.0),
        "shininess": (1.0, 100.0),
    },
    "paper": {"specular": (0.0, 5.0), "shininess": (0.0, 50.0)},  # those of the release
}


def require_material(factors: Mapping[str, float], kind: str) -> None:
    """Require factors that a range of materials can express.

    Raises:
        ArgumentError: naming the first that it cannot.
    """
    for name, (low, high) in RANGES[kind].items():
        if not low < factors[name] < high:
            raise ArgumentError(
                f"fit.first_material.{name}: expected a value between {low:g} and {high:g}, as "
                f"material_range={kind} has them, got {factors[name]:g}"
            )


@dataclass
class TextureKeys:
    """Texels: how many, and how they are found."""

    texels: int | None = key(None, "in all; default where they are seen, about one per pixel", least=1)
    sweeps: int = key(3, "of the least-squares solver over all views", least=0)
    iterations: int = key(0, "of Adam on L1 + D-SSIM afterwards", least=0)
    rate: float = key(0.0025, "of Adam at the start, of texels", least=0)
    palette_rate: float = key(
        0.0, "the same of the palette, which starts at the mean colour of the views; 0: it stays", least=0
    )
    final: float = key(0.1, "both rates at the end, relative to the start", least=0)
    ridge: float = key(0.2, "of the solver: how strongly texels stay at 0, relative", least=0)
    sparsity: float = key(
        0.0, "weight of the L1 norm of the image of texels alone, without palette and light", least=0
    )
    has_offset: bool = key(True, "surfels keep their colours as offsets; the paper has none")
