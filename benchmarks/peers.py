"""The rasterizer against what else renders surfels on this machine, in the same run."""

from __future__ import annotations

from benchmarks import gsplat_cpu, gsplat_cuda, instruction_sets, scalar
from benchmarks.report import Section
from benchmarks.settings import Settings


def run(settings: Settings) -> Section:
    """On a CPU gsplat's torch functions, a scalar loop and weaker instruction sets; on a GPU gsplat."""
    section = Section()
    if settings.device.type == "cuda":
        gsplat_cuda.compare(settings, section)
    else:
        for peer in (gsplat_cpu, scalar, instruction_sets):
            peer.compare(settings, section)
    return section
