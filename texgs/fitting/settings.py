"""Settings of fits of surfels and 3D Gaussians: their phases, and where they start."""

from dataclasses import asdict, dataclass

from texgs.core.keys import key


@dataclass(frozen=True)
class CommonRates:
    """Learning rates of Adam at the start of a phase, of surfels and of 3D Gaussians."""

    means: float = key(1.6e-4, "rate of means, times the extent of the cameras", "world units", least=0)
    quats: float = key(0.004, "rate of quaternions, of normals too", least=0)
    scales: float = key(0.02, "rate of the logarithm of scales", least=0)
    opacities: float = key(0.2, "rate of the logit of opacities", least=0)
    sh: float = key(0.01, "rate of the zeroth spherical harmonic", least=0)
    sh_rest: float = key(0.0005, "rate of the other spherical harmonics", least=0)
    means_final: float = key(0.01, "rate of means at the end, relative to the start", least=0)
    final: float = key(0.05, "the other rates at the end, relative to the start", least=0)


@dataclass(frozen=True)
class Rates(CommonRates):
    """Learning rates of Adam at the start of a phase."""

    colors: float = key(0.01, "rate of surfel colours", least=0)
    material: float = key(0.02, "rate of raw ambient, diffuse, specular and shininess", least=0)


@dataclass(frozen=True)
class Losses:
    """Weights of the losses."""

    dssim: float = key(0.2, "lambda: weight of D-SSIM against L1, of colour and of alpha", least=0)
    alpha: float = key(0.1, "weight of L1 + D-SSIM of alpha", least=0)
    alpha_l1: bool = key(True, "alpha's L1 has a gradient; in the release only its D-SSIM has")
    normal: float = key(0.0, "weight of normal consistency", least=0)
    normal_from: int = key(0, "iteration from which normal consistency counts", least=0)
    smoothness: float = key(
        0.0, "weight of bilateral smoothness of each map of a per-surfel material", least=0
    )


@dataclass(frozen=True)
class Densify:
    """Adaptive density control."""

    start: int = key(100, "iteration after which density control starts", least=0)
    stop: int = key(1300, "last iteration of density control", least=0)
    every: int = key(50, "iterations between steps of density control", least=1)
    threshold: float = key(
        2e-4, "mean screen-space gradient, half image widths, that clones or splits", least=0
    )
    size: float = key(0.01, "scale, in extents, above which one is split, not cloned", least=0)
    cap: int | None = key(
        30000, "surfels or Gaussians that density control adds to at most; null: no limit", least=1
    )
    prune_opacity: float = key(0.005, "what has less opacity is removed", least=0)
    prune_size: float = key(0.1, "what has a larger scale, in extents, is removed", least=0)
    prune_size_from: int = key(0, "iteration after which what is too large is removed", least=0)
    resets: list[int] = key(list, "iterations after which no opacity is above 0.01", least=1)


@dataclass(frozen=True)
class Phase:
    """One run of the loop."""

    iterations: int = key(0, "iterations, each of one view", least=0)
    sh_degree: int = key(
        3, "degree of the spherical harmonics, in the phase without shading", least=0, most=3
    )
    sh_every: int = key(1000, "iterations between degrees", least=1)
    turns_normals: bool = key(True, "shading has gradients into normals; in the release it has none")
    rates: Rates = key(Rates, "learning rates")
    losses: Losses = key(Losses, "weights of the losses")
    densify: Densify = key(Densify, "density control")


SEEDS = ("auto", "points", "volume", "visible", "hull", "random")


@dataclass(frozen=True)
class Seeds:
    """The start of surfels or Gaussians."""

    kind: str = key(
        "auto",
        "where seeds are; auto: where rays end in the volume if there is one, else visible",
        choices=SEEDS,
    )
    count: int | None = key(
        None,
        "number of seeds; default of volume and visible as many as density control keeps, else 10000; given "
        "points are taken as they are",
        least=1,
    )
    opacity: float = key(0.1, "opacity of each seed", above=0, below=1)
    half_size: float | None = key(
        None,
        "half the side of the cube of seeds, in halves of the data's longest side; default the data's box",
        above=0,
    )


@dataclass(frozen=True)
class GaussianKeys:
    """The fit of 3D Gaussians, in one phase of the same loop as for surfels."""

    iterations: int = key(30000, "iterations, each of one view", least=0)
    sh_degree: int = key(3, "degree of the spherical harmonics", least=0, most=3)
    sh_every: int = key(1000, "iterations between degrees", least=1)
    antialiased: bool = key(False, "thin Gaussians keep their weight in images of every size")
    dssim: float = key(0.2, "lambda: weight of D-SSIM against L1", least=0)
    alpha: float = key(0.0, "weight of L1 + D-SSIM of alpha", least=0)
    rates: CommonRates = key(CommonRates, "learning rates")
    densify: Densify = key(Densify, "density control")
    seeds: Seeds = key(Seeds, "where Gaussians start")

    @property
    def phase(self) -> Phase:
        """The run of the loop."""
        return Phase(
            self.iterations,
            self.sh_degree,
            self.sh_every,
            rates=Rates(**asdict(self.rates)),
            losses=Losses(self.dssim, self.alpha),
            densify=self.densify,
        )


@dataclass(frozen=True)
class Material:
    """Start values of Blinn-Phong factors in the shading phase."""

    ambient: float = key(0.5, "ambient factor k_a", least=0)
    diffuse: float = key(0.5, "diffuse factor k_d", least=0)
    specular: float = key(0.1, "specular factor k_s", least=0)
    shininess: float = key(20.0, "shininess, the exponent beta", least=0)


@dataclass(frozen=True)
class TextureKeys:
    """Number of texels, and how they are fitted."""

    texels: int | None = key(
        None, "texels in all, of one edge; default where they are seen, about one per pixel", least=1
    )
    sweeps: int = key(1, "sweeps of the least-squares solver over its views", least=0)
    views: float = key(
        0.9,
        "share of training views, spread, that the solver sees; the others, or all, tell how far texels go",
        above=0,
        most=1,
    )
    iterations: int = key(0, "iterations of Adam on L1 + D-SSIM after the solver", least=0)
    rate: float = key(0.0025, "rate of Adam at the start, of texels", least=0)
    palette_rate: float = key(
        0.0,
        "rate of Adam at the start, of the palette, which begins at the views' mean colour; 0: it stays",
        least=0,
    )
    final: float = key(0.1, "both rates at the end, relative to the start", least=0)
    ridge: float = key(0.2, "how strongly the solver holds texels at their start, relative", least=0)
    sparsity: float = key(
        0.0, "weight of the L1 norm of the image of texels alone, without palette and light", least=0
    )
    has_offset: bool = key(True, "surfels keep their colours as offsets from the palette; the paper has none")
