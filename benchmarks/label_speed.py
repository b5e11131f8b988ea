"""What labels cost: views of ten beside views of one, and time and memory to make their masks.

`python -m benchmarks.label_speed OUTPUT.json FILE` looks at the ten largest labels of a file from one side,
all of them framed: together, each alone, and as one channel of numbers. Their masks are made in a process of
its own, and so are those of a raw file of 1024 x 1024 x 256 samples. Times are those of a processor, by one
thread, which other work disturbs least.
"""

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
import torch

from benchmarks import machine, report
from benchmarks.command import call
from benchmarks.labels import LIGHT, MOST, Labelled, found_at, volumes
from benchmarks.report import Measurement, Section
from benchmarks.settings import ROUNDS
from benchmarks.timing import threads
from texgs.core.memory import peak_memory
from texgs.core.progress import progress
from texgs.volume.caster import Caster
from texgs.volume.overlay import overlays
from texgs.volume.render import Appearance
from texgs.volume.settings import VolumeKeys, open_masks, prepare_fields

SIZE = 400  # pixels of either side
LARGE = (1024, 1024, 256)  # samples along x, y, z; 16 bits


def main(output: str, file: str) -> None:
    """Measure the labels of a file, print what it takes and write it."""
    _, volume = volumes([file])
    with machine.Load() as load:
        section = views(volume, SIZE, ROUNDS)
    with TemporaryDirectory() as folder:
        section.measurements += masks(found_at(file), VolumeKeys(), volume.numbers)
        made = made_file(Path(folder), LARGE)
        section.measurements += masks(made, VolumeKeys(dims=[*LARGE], dtype="uint16"), range(1, MOST + 1))
    report.show(file, section)
    print(load)
    facts = {"machine": machine.describe(torch.device("cpu")), "load": asdict(load)}
    Path(output).write_text(json.dumps({**facts, **asdict(section)}, indent=1) + "\n")


def views(volume: Labelled, size: int, rounds: int) -> Section:
    """Return times of views of all labels, of numbers and of each label, and ratios of all to others."""
    caster, numbers = Caster(volume.masks, Appearance()), Caster(volume.grid, Appearance())
    (camera,) = volume.cameras(size, 1)
    tfs = dict(zip(map(str, volume.numbers), volume.of_masks, strict=True))
    one_channel = overlays(dict(zip(tfs, volume.of_numbers, strict=True)))
    shown = {"all": (caster, [*tfs.values()]), "all, as numbers": (numbers, one_channel)}
    shown |= {name: (caster, [tf]) for name, tf in tfs.items()}
    casts = {name: partial(each.cast, tf, camera, LIGHT) for name, (each, tf) in shown.items()}
    times: dict[str, list[float]] = {name: [] for name in casts}
    with threads(1):
        for _ in progress(range(rounds), title=volume.name, unit="round"):
            for name, cast in casts.items():
                cast()  # what it prepares is kept
                times[name].append(1e3 * processor_seconds(cast))
    found = [Measurement.of("view", {"size": size, "labels": name}, "ms", x) for name, x in times.items()]
    together, of_numbers, *one = found
    others = {"the slowest": max(one, key=lambda m: m.median), "numbers": of_numbers}
    return Section([*found, *(together.over(other, f"all / {name}") for name, other in others.items())])


def processor_seconds(run: Callable[[], object]) -> float:
    """Return what a function takes of processors, whatever else they do."""
    start = process_time()
    run()
    return process_time() - start


def masks(file: Path, keys: VolumeKeys, numbers: Sequence[int]) -> list[Measurement]:
    """Return processor time and megabytes that the masks of a file take, in a process of its own."""
    where = {"file": file.name, "masks": len(numbers)}
    words = json.dumps({"file": str(file), "keys": asdict(keys), "numbers": [*map(str, numbers)]})
    said, complaint = (process := machine.child("label_speed.child", words)).communicate()
    if process.returncode:
        sys.exit(machine.last_line(complaint))
    seconds, peak = json.loads(machine.last_line(said))
    return [
        Measurement.of("masks", where, "ms", [1e3 * seconds]),
        Measurement.of("peak memory", where, "MB", [peak]),
    ]


def child() -> None:
    """Make masks as told by the first argument; print seconds and the peak of memory, megabytes."""
    told = json.loads(sys.argv[1])
    keys, file = VolumeKeys(**told["keys"]), Path(told["file"])
    sources = open_masks(keys, file, told["numbers"])
    with TemporaryDirectory() as folder:
        seconds = processor_seconds(partial(prepare_fields, keys, sources, Path(folder, "volume.nrrd")))
    print(json.dumps([seconds, 1e-6 * peak_memory()]))


def made_file(folder: Path, dims: tuple[int, int, int]) -> Path:
    """Write a raw file of ten labels, shells around its middle one within the other, layer by layer."""
    x, y, z = (np.linspace(-1, 1, size, dtype=np.float32) for size in dims)
    path = folder / "labels.raw"
    with path.open("wb") as file:
        for height in z:
            distance = np.sqrt(x**2 + y[:, None] ** 2 + height**2)
            label = MOST - np.floor(distance * MOST)
            file.write(label.clip(0).astype("<u2").tobytes())
    return path


if __name__ == "__main__":
    call(main, "texgs.volume.label_masks texgs.volume.prepare texgs.volume.caster")
