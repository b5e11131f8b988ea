"""A step of the shading phase with every map and loss, and where its time goes.

`python -m benchmarks.fit OUTPUT.json TREE` times steps of `quick`'s losses, of few surfels in small views,
which are all overhead, and of many in larger ones, by the code here and by that of another source tree, which
is built. Two processes take turns; a ratio is the median of those of the turns.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from statistics import median
from time import perf_counter

import torch
from torch import Tensor
from torch.profiler import ProfilerActivity, profile

from benchmarks import machine, scenes
from benchmarks.command import call
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
TURNS, STEPS, WARM = 15, {33: 200, 400: 25}, 20
PAIRS = (("shells", 33, 200), ("ball", 400, 20_000), ("shells", 400, 20_000))  # scene, image size, surfels
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


def beside(output: str, tree: str) -> None:
    """Time both; print and write milliseconds and ratios."""
    pairs = {}
    for scene, size, n in PAIRS:
        here, there = (stepping(root, scene, size, n) for root in (str(machine.ROOT), tree))
        turns = [(turn(here), turn(there)) for _ in range(TURNS)]
        here.communicate(), there.communicate()
        new, old = (round(median(times), 4) for times in zip(*turns, strict=True))
        ratio = round(median(mine / other for mine, other in turns), 4)
        pairs[f"{scene}, {n} surfels, {size}x{size}"] = {"new ms": new, "old ms": old, "ratio": ratio}
    print(json.dumps(pairs, indent=1))
    described = machine.describe(torch.device("cpu"))
    Path(output).write_text(json.dumps({"machine": described, "steps": pairs}, indent=1) + "\n")


def stepping(root: str, scene: str, size: int, n: int) -> subprocess.Popen:
    """Start a process that takes steps by the code of a source tree when asked."""
    code = f"import sys; sys.path.insert(0, {root!r}); import texgs; sys.path[0] = {str(machine.ROOT)!r}; "
    code += f"from benchmarks.fit import serve; serve({scene!r}, {size}, {n})"
    return subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )


def turn(process: subprocess.Popen) -> float:
    """Let a process take its steps; the median, milliseconds."""
    assert process.stdin
    assert process.stdout
    process.stdin.write("\n")
    process.stdin.flush()
    return float(process.stdout.readline())


def serve(scene: str, size: int, n: int) -> None:
    """Take steps for each line of the input, and print their median, milliseconds."""
    keep_freed_memory()
    raw = raw_surfels(n, torch.device("cpu"))
    fit = training(size, raw if scene == "shells" else raw | ball(n), Losses())
    for _ in range(WARM):
        fit.step()
    for _ in sys.stdin:
        times = [perf_counter()]
        for _ in range(STEPS[size]):
            fit.step()
            times.append(perf_counter())
        print(1e3 * median(b - a for a, b in pairwise(times)), flush=True)


def with_maps(raw: dict[str, Tensor]) -> dict[str, Tensor]:
    """Return surfels with a material each."""
    return raw | {name: raw[name].repeat(len(raw["means"])) for name in MATERIAL}


def ball(n: int) -> dict[str, Tensor]:
    """Return the shape of surfels that cover a sphere of radius 1 once."""
    points, normals = scenes.sphere(n)
    scales = torch.full((n, 2), 0.6 * (4 * torch.pi / n) ** 0.5)
    means = torch.nn.functional.normalize(points, dim=1).float()
    return {"means": means, "quats": scenes.facing(normals.float(), torch.zeros(n)), "scales": scales.log()}


def training(size: int, raw: dict[str, Tensor], losses: Losses = LOSSES) -> Fit:
    """The shading phase of the paper on views of a generated scene that was slightly moved."""
    phase = Phase(10**9, losses=losses, rates=RATES, densify=Densify(start=10**9, stop=10**9))
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
    for known, names in PARTS.items():
        if name in names:
            return known
    return "everything else"


if __name__ == "__main__":
    call(beside, "benchmarks.fit")
