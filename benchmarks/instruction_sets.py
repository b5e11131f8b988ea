"""The library's instruction sets against each other: worker processes that take turns."""

import json
import subprocess
import sys
from collections import defaultdict
from functools import partial

import torch

from benchmarks import losses, machine, workload
from benchmarks.convolution import pair, random_vgg
from benchmarks.report import Measurement, Section
from benchmarks.settings import Settings, parse
from benchmarks.timing import Case, visit
from benchmarks.views import LIGHT, SHELLS
from texgs.core.lens import Lens
from texgs.raster import native
from texgs.volume.cameras import icosphere
from texgs.volume.caster import Caster
from texgs.volume.generate import sphere
from texgs.volume.render import Appearance

SETS = ("avx512", "avx2", "portable")


def run(settings: Settings) -> Section:
    """Time passes of the rasterizer, rays through a volume and losses with each, and as ratios to the best.

    TEXGS_ISA is read as the library is opened: each set has a process, which times one visit per line that it
    is sent and sleeps in between.
    """
    section = Section()
    if settings.device.type != "cpu":
        section.skip("instruction sets", "they are those of CPUs")
        return section
    workers = {}
    samples: dict[tuple[str, str, str], list[float]] = defaultdict(list)
    try:
        for name in SETS:
            worker = _start(name, settings)
            if worker.stdout.readline():
                workers[name] = worker
            else:
                section.skip(f"instruction set {name}", machine.last_line(worker.stderr.read()))
        for _ in range(settings.rounds):
            for name, worker in workers.items():
                print(file=worker.stdin, flush=True)
                for kernel, quantity, seconds in json.loads(worker.stdout.readline()):
                    samples[name, kernel, quantity].append(1e3 * seconds)
    finally:
        for worker in workers.values():
            worker.terminate()
            worker.wait()
    for (name, kernel, quantity), values in samples.items():
        where = settings.where(peer=name, kernel=kernel)
        section.measurements.append(Measurement.of(quantity, where, "ms", values))
    if best := workers.keys() & {native.instruction_set()}:
        names = {quantity for _, _, quantity in samples}
        own = Section([m for m in section.measurements if m.parameters["peer"] in SETS])
        own.add_ratios("peer", *best, names)
        section.measurements += [m for m in own.measurements if m.unit == "ratio"]
    return section


def child() -> None:
    """Say that the library is open, then time one visit per line of standard input."""
    settings = parse(sys.argv[1:])
    cases = _cases(settings)
    print(json.dumps(native.instruction_set()), flush=True)
    for _ in sys.stdin:
        timings = [
            (case.parameters["kernel"], *timed) for case in cases for timed in visit(case, settings.device)
        ]
        print(json.dumps(timings), flush=True)


def _cases(settings: Settings) -> list[Case]:
    """What is timed: `kernel` says of what the passes are."""
    at, cases = (settings.size, settings.n_surfels, settings.device), []
    for scene in dict.fromkeys((settings.scene, "transl")):
        cases += workload.plain(scene, *at).cases({"kernel": scene})
    for texels in ((3, 4), (5, 8)):
        kernel = f"textures of {texels[0]} to {texels[1]} texels squared"
        cases += workload.textured(settings.scene, *at, texels).cases({"kernel": kernel})
    caster, shot = Caster(sphere(64), Appearance()), icosphere(1, Lens().square(settings.size // 2))[0]
    frame = partial(caster.render, SHELLS, shot, LIGHT)
    cases.append(Case("frame", {"kernel": "caster"}, {"frame": frame}))
    for loss in losses.images(settings):
        both = losses.differentiated(loss.functions["texgs"], loss)
        cases.append(Case(losses.NAME, {"kernel": loss.name}, {losses.NAME: both}))
    network = random_vgg(settings.device, torch.float32)
    cases.append(pair(network, {"kernel": "convolution", "size": settings.size // 4}))
    return cases


def _start(name: str, settings: Settings) -> subprocess.Popen:
    size, n = str(settings.size), str(settings.n_surfels)
    words = ("--scenes", settings.scene, "--sizes", size, "--surfels", n)
    return machine.child("instruction_sets.child", *words, TEXGS_ISA=name)
