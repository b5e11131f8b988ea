"""The rasterizer against what else renders surfels on this machine, in the same run."""

from __future__ import annotations

from benchmarks import gsplat_cpu, gsplat_cuda, instruction_sets
from benchmarks.report import Section
from benchmarks.settings import Settings


def run(settings: Settings) -> Section:
    """Time gsplat's torch functions and weaker instruction sets on a CPU, and gsplat on a GPU."""
    section = Section()
    if settings.device.type == "cuda":
        gsplat_cuda.compare(settings, section)
    else:
        for peer in (gsplat_cpu, instruction_sets):
            peer.compare(settings, section)
    return section
