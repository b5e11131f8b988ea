"""Stage `page`: a scene as one HTML file that shows and edits it in a browser, without a server."""

from dataclasses import dataclass
from pathlib import Path

from texgs.core.io import write_bytes
from texgs.core.memory import MIB
from texgs.report.results import PageResult
from texgs.scene.scene_file import read_scene
from texgs.viewer.standalone import write_page
from texgs.workflow.stages.outcome import Outcome
from texgs.workflow.stages.settings import FitLabel, OfDataset

SHOWN = "The scene: open it to turn it, to move its light, and to change colours and opacities."


@dataclass
class Settings(OfDataset):
    """What the stage reads of the configuration."""

    fit: FitLabel
    look: str  # name of the edit, or "none"
    look_seed: int  # its seed
    embedded: float  # MiB of the largest page that the report holds


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write scene.html and poster.jpg.

    Args:
        settings: of the job.
        inputs: `scene`, the scene.yaml.
        output: folder.
    """
    scene = read_scene(inputs["scene"])
    parts = [settings.dataset, settings.fit.name, *([settings.look] if settings.look != "none" else [])]
    page = write_page(output / "scene.html", scene, " ".join(parts))
    write_bytes(output / "poster.jpg", page.poster)
    mib = page.path.stat().st_size / MIB
    result = PageResult(settings.look, page.surfels, mib, mib <= settings.embedded)
    return Outcome(result, {"poster.jpg": SHOWN})
