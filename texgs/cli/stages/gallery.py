"""Stage `gallery`: show all new looks of a data set side by side."""

from dataclasses import dataclass
from pathlib import Path

import torch

from texgs.cli.stages.outcome import Outcome
from texgs.cli.stages.settings import Distance, OfDataset
from texgs.core.progress import progress
from texgs.report.before_after import POLAR, pictures
from texgs.report.results import GalleryResult
from texgs.report.strip import write_strip
from texgs.scene.scene_file import read_scene
from texgs.volume.cameras import orbit_path

SHOWN = "Every look of the data set from the same places, first the scene as its first recipe has it."
VIEWS, SIZE = 4, 400  # pictures of a look, and their pixels


@dataclass
class Settings(OfDataset):
    """What the stage reads of the configuration."""

    lens: Distance


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write gallery.png.

    Args:
        settings: of the job.
        inputs: scenes by what stands beside them.
        output: folder.
    """
    cameras, rows = orbit_path(VIEWS, POLAR, *settings.lens.lens.square(SIZE)), {}
    for name, path in progress(inputs.items(), title=f"{settings.dataset}: gallery", unit="look"):
        scene = read_scene(path)
        rows[name] = pictures(scene, cameras, [scene.light] * VIEWS, torch.device("cpu"))
    write_strip(output / "gallery.png", rows, [f"view {index + 1}" for index in range(VIEWS)])
    return Outcome(GalleryResult(list(rows)), {"gallery.png": SHOWN})
