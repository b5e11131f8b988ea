"""An image-driven edit of a textured model: seconds of its start, milliseconds of an iteration, by part."""

from benchmarks.convolution import random_vgg
from benchmarks.fit import DISTANCE, VIEWS
from benchmarks.report import Measurement, Section
from benchmarks.scene import model
from benchmarks.settings import Settings
from texgs.core.camera import Camera, orbit
from texgs.core.light import Light
from texgs.core.memory import keep_freed_memory
from texgs.edit.recipe import Recipe, preset
from texgs.edit.style_picture import StylePicture
from texgs.edit.stylize import Stylized, stylize
from texgs.fields.surfels.model import Surfels
from texgs.models.networks import fast_dtype
from texgs.models.pictures import picture
from texgs.models.vgg import Vgg

ITERATIONS, FEW = 10, 2  # of a run; the latter for --quick
RECIPES = ("default", "patches")


def run(settings: Settings) -> Section:
    """Time edits with each recipe; the weights of VGG are random, which takes as long."""
    keep_freed_memory()  # as the command line does
    section = Section()
    scene, vgg = model(0, settings.device), random_vgg(settings.device, fast_dtype(settings.device))
    style = StylePicture.of(picture("dots", 256))
    for size in settings.sizes:
        cameras = [orbit(-60.0 + 360 / VIEWS * i, 25.0, DISTANCE, 30.0, size, size) for i in range(VIEWS)]
        preview = [edited(scene, cameras, style, preset("preview"), None) for _ in range(1 + settings.rounds)]
        times = [1e3 * history.seconds["start"] for history in preview[1:]]  # the first one warms up
        section.measurements.append(Measurement.of("preview", {"size": size}, "ms", times))
        for name in RECIPES:
            recipe = preset(name, iterations=FEW if settings.is_quick else ITERATIONS)
            runs = [edited(scene, cameras, style, recipe, vgg) for _ in range(1 + settings.rounds)]
            section.measurements += iterations(runs[1:], {"size": size, "recipe": name}, recipe.iterations)
    return section


def edited(
    scene: Surfels, cameras: list[Camera], style: StylePicture, recipe: Recipe, vgg: Vgg | None
) -> Stylized:
    """How an edit went."""
    lights = [Light("headlight")] * len(cameras)
    return stylize(scene, cameras, lights, style, recipe, vgg=vgg, title="benchmark")


def iterations(runs: list[Stylized], where: dict[str, object], count: int) -> list[Measurement]:
    """Milliseconds of an iteration, as a whole and by part; and of the start, once."""
    parts = [name for name in runs[0].seconds if name != "start"]
    milliseconds = {f"part {name}": [1e3 * run.seconds[name] / count for run in runs] for name in parts}
    milliseconds["iteration"] = [sum(times) for times in zip(*milliseconds.values(), strict=True)]
    milliseconds["start"] = [1e3 * run.seconds["start"] for run in runs]
    return [Measurement.of(name, where, "ms", values) for name, values in milliseconds.items()]
