"""A toy of a stage: the maximum intensity projection of a volume. All that a stage needs is in one file."""

from dataclasses import dataclass

from texgs.report.results import Result
from texgs.workflow.inputs import has_volume, prepared_volume
from texgs.workflow.stage import Outcome, Rule, Stage
from texgs.workflow.stages.settings import OfDataset


@dataclass(frozen=True)
class ProjectionResult(Result, section="data"):
    """What metrics.json holds of it."""

    mean: float  # of the picture, 0 to 1


def work(settings: OfDataset, inputs, output):
    """Write projection.png, the largest sample along z."""
    import torch

    from texgs.core.image import write_png
    from texgs.volume.nrrd_file import open_grid

    largest = torch.tensor(open_grid(inputs["volume"]).values.max(axis=0)).float()
    picture = (largest - largest.min()) / (largest.max() - largest.min()).clamp_min(1e-6)
    write_png(output / "projection.png", picture[..., None].expand(-1, -1, 3))
    return Outcome(ProjectionResult(float(picture.mean())), {"projection.png": "Largest sample along z."})


STAGE = Stage(
    "projection",
    order=25,
    help="project a volume by its largest samples",
    rule=Rule("projection", "{dataset}/projection", ("projection.png",), target="volumes", threads=1),
    inputs=prepared_volume,
    work=work,
    applies=has_volume,
)
