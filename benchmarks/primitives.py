"""3D Gaussians beside the surfels that they are made from: rendering, and a pass with gradients."""

from functools import partial
from itertools import product

from benchmarks import scenes, workload
from benchmarks.report import Measurement, Section
from benchmarks.settings import Settings
from benchmarks.timing import measure
from benchmarks.workload import Workload
from texgs.raster import rasterize

SCENES = ("opaque", "transl")
MAKERS = {
    "surfels": scenes.surfels,
    "flat gaussians": partial(scenes.gaussians, thickness=1e-3),  # the same ellipses, but for the filters
    "gaussians": scenes.gaussians,
}


def run(settings: Settings) -> Section:
    """Time both, how many fragments each blends, and the ratios of Gaussians to surfels."""
    cases, fragments = [], []
    chosen = [scene for scene in SCENES if scene in settings.scenes] or [settings.scene]
    places = [
        {"scene": scene, "size": size, "surfels": settings.n_surfels}
        for scene, size in product(chosen, settings.sizes)
    ]
    for place, (primitive, make) in product(places, MAKERS.items()):
        made = workload.plain(*place.values(), settings.device, make=make)
        where = place | {"primitive": primitive}
        cases += made.cases(where)
        fragments.append(Measurement.of("fragments", where, "1", [blended(made)]))
    section = Section(measure(cases, settings.rounds, settings.device, "primitives") + fragments)
    section.add_ratios("primitive", "surfels", ("forward", "forward+backward", "fragments"))
    return section


def blended(made: Workload) -> float:
    """How many fragments a workload blends."""
    arguments = made.arguments | {"outputs": ("statistics",)}
    return float(rasterize(**arguments).statistics.pixels.double().sum())
