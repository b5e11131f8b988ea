"""What else a pass can give: more images and channels, textures, a backward pass of the colours, a splat."""

from benchmarks import workload
from benchmarks.report import Section
from benchmarks.settings import Settings
from benchmarks.timing import Case, measure
from benchmarks.workload import Workload
from texgs.raster import splat

SHADING = 4  # channels of ambient, diffuse and specular factor and exponent
VARIANTS = {  # outputs and channels
    "plain": ((), 3),
    "normal and depth": (("normal", "depth"), 3),
    "4 more channels": ((), 3 + SHADING),
    "normal, depth, 4 more channels": (("normal", "depth"), 3 + SHADING),
    "all outputs": (("normal", "depth", "median", "distortion", "statistics"), 3),
}
TEXELS = {"texture 4x4": (4, 4), "texture 2..8 x 2..8": (2, 8), "texture 9..16 x 9..16": (9, 16)}
RATIOS = ("forward", "forward+backward")


def run(settings: Settings) -> Section:
    """Time the variants, each also as a ratio to the plain one."""
    where = (settings.scene, settings.size, settings.n_surfels, settings.device)
    cases = []
    for variant, (outputs, channels) in VARIANTS.items():
        made = workload.plain(*where, outputs=outputs, channels=channels)
        cases += made.cases(settings.where(variant=variant))
    features = workload.plain(*where, learned=("features",))
    cases += features.cases(settings.where(variant="features learn, geometry frozen"))
    for variant, texels in TEXELS.items():
        made = workload.textured(*where, texels)
        cases += made.cases(settings.where(variant=f"{variant}, texels learn"))
    cases.append(_splat(features, settings.where(variant="splat 3 channels")))
    section = Section(measure(cases, settings.rounds, settings.device, "outputs"))
    section.add_ratios("variant", "plain", RATIOS)
    return section


def _splat(made: Workload, where: dict) -> Case:
    """Splat the scene's own image back."""
    image = made.image().color
    a = made.arguments
    surfels = [a[name].detach() for name in workload.GEOMETRY]
    return Case("splat", where, {"splat": lambda: splat(image, *surfels, a["viewmat"], a["K"])})
