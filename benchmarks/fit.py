"""A step of the shading phase with every map and loss, and where its time goes."""

from collections import defaultdict

import torch
from torch import Tensor
from torch.profiler import ProfilerActivity, profile

from benchmarks import scenes
from benchmarks.report import Measurement, Section
from benchmarks.settings import Settings
from benchmarks.timing import Case, measure
from texgs.core.camera import orbit
from texgs.core.lens import Lens
from texgs.core.light import Light
from texgs.core.memory import keep_freed_memory
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, raw_material
from texgs.fitting.loop import Fit
from texgs.fitting.settings import Densify, Losses, Phase, Rates
from texgs.raster.shading import MATERIAL
from texgs.volume.images import Images

SURFELS = {400: 15_000, 800: 40_000}  # by image size; for other sizes those of the settings
VIEWS = 8
DISTANCE = 2 * Lens().radius  # as the paper's cameras see an object of side 2
PROFILED = 40  # steps
LOSSES = Losses(alpha=0.1, normal=0.05, smoothness=0.01)
RATES = Rates(*[1e-12] * 8)  # the scene stays as heavy as it is
PARTS = {  # by what the profiler's names contain; the first that fits
    "rasterizer and losses": ("_ViewLoss", "_ViewLossBackward"),
    "shading": ("_BlinnPhong", "_BlinnPhongBackward"),
}


def run(settings: Settings) -> Section:
    """Time whole steps, then profile some for their parts."""
    keep_freed_memory()  # as the command line does
    section = Section()
    counts = {size: SURFELS.get(size, settings.n_surfels) for size in settings.sizes}
    fits = {size: training(size, with_maps(raw_surfels(n, settings.device))) for size, n in counts.items()}
    places = {size: {"size": size, "surfels": n} for size, n in counts.items()}
    cases = [Case("step", where, {"step": fits[size].step}) for size, where in places.items()]
    section.measurements = measure(cases, settings.rounds, settings.device, "fit")
    for size, fit in fits.items():
        for name, ms in parts(fit).items():
            section.measurements.append(Measurement(f"part {name}", places[size], "ms", ms, ms, PROFILED))
    return section


def with_maps(raw: dict[str, Tensor]) -> dict[str, Tensor]:
    """Return surfels with a material each."""
    return raw | {name: raw[name].repeat(len(raw["means"])) for name in MATERIAL}


def training(size: int, raw: dict[str, Tensor]) -> Fit:
    """The shading phase of the paper on views of a generated scene that was slightly moved."""
    phase = Phase(10**9, losses=LOSSES, rates=RATES, densify=Densify(start=10**9, stop=10**9))
    moved = raw | {"means": raw["means"] + 0.003}
    return Fit(moved, ShadingModel(), views(Surfels(raw), size), phase, seed=0)


def raw_surfels(n: int, device: torch.device, seed: int = 0) -> dict[str, Tensor]:
    """Return a generated scene as parameters of a model, with one material for all."""
    made = scenes.surfels("opaque", n, seed)
    shape = {"means": made["means"], "quats": made["quats"], "scales": made["scales"].log()}
    colors = {"opacities": made["opacities"].logit(), "colors": made["features"]}
    raw = shape | colors | raw_material(0.3, 0.7, 0.3, 20.0, "bounded")
    return {name: x.to(device) for name, x in raw.items()}


@torch.no_grad()
def views(model: Surfels, size: int) -> Images:
    """Views around a model, as 8-bit images."""
    cameras = [orbit(-60.0 + 360 / VIEWS * i, 25.0, DISTANCE, 30.0, size, size) for i in range(VIEWS)]
    shown = [model.render(camera.to(model.device)) for camera in cameras]
    planes = [torch.cat([x.color.permute(2, 0, 1), x.alpha[None]]) for x in shown]
    eight_bits = torch.stack(planes).clamp(0, 1).mul(255).round().to(torch.uint8).cpu()
    return Images(eight_bits, cameras, [Light("headlight")] * VIEWS)


def parts(fit: Fit) -> dict[str, float]:
    """Milliseconds of a step by part, from the profiler; what is none of PARTS is `everything else`."""
    gpu = fit.parameters["means"].is_cuda
    activities = [ProfilerActivity.CPU, *([ProfilerActivity.CUDA] if gpu else [])]
    fit.step()
    with profile(activities=activities) as recorded:
        for _ in range(PROFILED):
            fit.step()
    milliseconds: dict[str, float] = defaultdict(float)
    for event in recorded.key_averages():
        taken = event.self_device_time_total if gpu else event.self_cpu_time_total
        milliseconds[part(event.key)] += taken / PROFILED / 1e3
    return dict(milliseconds)


def part(name: str) -> str:
    """The part that an event belongs to."""
    return next((known for known, names in PARTS.items() if name in names), "everything else")
