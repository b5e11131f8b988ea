"""Rendering alone, and a training step: forward, backward and fused Adam, for every scene."""

from itertools import product

from benchmarks import workload
from benchmarks.report import Section
from benchmarks.settings import Settings
from benchmarks.timing import Case, measure


def run(settings: Settings) -> Section:
    """Time every scene, size and number of surfels on each number of threads."""
    is_cpu = settings.device.type == "cpu"
    cases = []
    for scene, size, n in product(settings.scenes, settings.sizes, settings.surfels):
        made = workload.plain(scene, size, n, settings.device)
        step = {"step forward": made.forward, "step backward": made.backward, "step Adam": made.adam}
        for threads in settings.threads:
            where = {"scene": scene, "size": size, "surfels": n, "threads": threads}
            cases.append(Case("forward", where, {"forward": made.image}, threads))
            cases.append(Case("step", where, step, threads, has_passes=is_cpu))
    section = Section(measure(cases, settings.rounds, settings.device, "rasterize"))
    if not is_cpu:
        section.skip("passes", "the CUDA library does not time its passes")
    return section
