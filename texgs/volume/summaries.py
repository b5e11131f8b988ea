"""A JSON beside a prepared volume, volume.json: lattice, range and histogram, of each channel."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from texgs.core.io import read_json, write_json
from texgs.volume.prepare import Summary


def summary_file(volume: Path) -> Path:
    """Return the file beside a prepared volume that says what is in it."""
    return volume.with_suffix(".json")


def write_summaries(volume: Path, summaries: Sequence[Summary], channels: Sequence[str]) -> Path:
    """Write the summaries of a volume.nrrd; those of several channels by their labels, below the first."""
    said = asdict(summaries[0])
    if len(summaries) > 1:
        said["channels"] = dict(zip(channels, map(asdict, summaries), strict=True))
    return write_json(summary_file(volume), said)


def read_summaries(volume: Path) -> dict[str, dict[str, Any]]:
    """Return the summaries of a volume.nrrd by the labels of channels, in their order; of one by ""."""
    said = read_json(summary_file(volume))
    return dict(said["channels"]) if "channels" in said else {"": said}
