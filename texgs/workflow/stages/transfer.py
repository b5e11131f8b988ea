"""Stage `transfer`: compare a data set's basic TFs with its values, plot them, and export them."""

import sys
from dataclasses import dataclass
from pathlib import Path

from texgs.core.memory import free_memory
from texgs.core.names import mask_name
from texgs.report.results import Result
from texgs.volume.basic_tfs import BasicTF, basic_tfs_of
from texgs.workflow.inputs import has_volume, prepared_volume
from texgs.workflow.stage import Outcome, Rule, Stage, read
from texgs.workflow.stages.settings import OfDataset


@dataclass(frozen=True)
class TransferResult(Result, section="data"):
    """Basic transfer functions over a histogram."""

    basic_tfs: int
    ranges: dict[str, list[float]]  # lowest and highest value of each


@dataclass(kw_only=True)
class Settings(OfDataset):
    """What the stage reads of the configuration."""

    title: str = read("dataset.title")
    tf_values: str = read("dataset.tf_values")
    basic_tfs: dict[str, BasicTF] = read("dataset.basic_tfs")


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write transfer.png, the histogram with the basic TFs over it and casts of them, and TFs for ParaView.

    It reads `volume`, the volume.nrrd; volume.json is beside it.
    """
    from texgs.core.figures import write_figure
    from texgs.volume.nrrd_file import open_grid
    from texgs.volume.summaries import read_summaries
    from texgs.volume.tf_files import write_paraview
    from texgs.volume.tf_plot import casts_of, plot
    from texgs.volume.transfer import check_disjoint

    basic = basic_tfs_of(inputs["volume"], settings.basic_tfs, settings.tf_values)
    check_disjoint(basic)
    channels = read_summaries(inputs["volume"])
    has_room = inputs["volume"].stat().st_size <= free_memory()
    if not has_room:
        sys.stderr.write(f"{settings.dataset}: too large for the memory that is free to picture its TFs\n")
    casts = casts_of(open_grid(inputs["volume"]), basic) if has_room else None
    write_figure(output / "transfer.png", plot(channels, basic, settings.title, casts=casts))
    for name, tf in basic.items():
        write_paraview(output / f"{name}.paraview.json", tf, f"{settings.dataset} {name}")
    ranges = {name: list(tf.support) for name, tf in basic.items()}
    has_labels_only = all(name.startswith(mask_name("")) for name in channels)
    shown = {"transfer.png": "Sizes of the labels, and a view of each."} if has_labels_only else None
    return Outcome(TransferResult(len(basic), ranges), shown)


STAGE = Stage(
    "transfer",
    order=20,
    help="plot the histogram with the basic transfer functions, and export these",
    rule=Rule(
        "transfer",
        "{dataset}/transfer",
        ("transfer.png",),
        target="volumes",
        threads=1,
        shown={"transfer.png": "Histogram of the volume with the basic transfer functions."},
    ),
    inputs=prepared_volume,
    work=work,
    applies=has_volume,
)
