"""Stage `volume`: make or read a scalar field, check it, and write the one file that later stages read."""

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from texgs.cli.stages.outcome import Outcome
from texgs.config.locate import cached_volume
from texgs.core.io import write_json
from texgs.core.progress import progress
from texgs.report.results import VolumeResult
from texgs.volume.download import require_whole
from texgs.volume.generate import GENERATORS, RANDOM
from texgs.volume.prepare import prepare
from texgs.volume.slabs import ArraySource, Source
from texgs.volume.sources import open_source


def work(settings: dict[str, Any], inputs: dict[str, Path], output: Path) -> Outcome:
    """Write volume.nrrd, which ParaView opens too, and volume.json: lattice, range and histogram.

    Args:
        settings: what the stage reads of the configuration.
        inputs: `source`, the volume's file, where it is not generated.
        output: folder.
    """
    volume = settings["volume"]

    def slabs(steps: Iterable[tuple[int, int]], total: int) -> Iterable[tuple[int, int]]:
        return progress(steps, total, title=f"{settings['dataset']}: volume", unit="slab")

    summary = prepare(
        generated(volume) if volume["generator"] is not None else source(volume, inputs["source"]),
        output / "volume.nrrd",
        crop=volume["crop"] and tuple(volume["crop"]),
        reduce=volume["reduce"],
        method=volume["method"],
        up=volume["up"],
        nan_value=volume["nan_value"],
        progress=slabs,
    )
    write_json(output / "volume.json", asdict(summary))
    return Outcome(
        VolumeResult(
            list(summary.dims),
            summary.dtype,
            list(summary.spacing),
            list(summary.origin),
            summary.minimum,
            summary.maximum,
            summary.voxels,
            volume_mib=(output / "volume.nrrd").stat().st_size / 2**20,
        )
    )


def generated(volume: dict[str, Any]) -> Source:
    """The field of a generator."""
    options = {"seed": volume["seed"]} if volume["generator"] in RANDOM else {}
    return ArraySource(GENERATORS[volume["generator"]](volume["size"], **options), volume["generator"])


def source(volume: dict[str, Any], path: Path) -> Source:
    """The field of a file; one that was downloaded is compared with its checksum."""
    if volume["url"] and path == cached_volume(volume):
        require_whole(path, volume["sha256"])
    triples = {key: volume[key] and tuple(volume[key]) for key in ("dims", "spacing", "origin")}
    return open_source(path, dtype=volume["dtype"], endian=volume["endian"], skip=volume["skip"], **triples)
