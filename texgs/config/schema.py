"""The typed schema of conf/: every key with its type, default, unit and meaning.

Files of conf/ become instances of these classes, so an unknown key or a value of the wrong type is an error
that names the key. `texgs views --help` lists all keys with their defaults.
"""

from dataclasses import dataclass, replace
from typing import Literal

from texgs.config.dataset import Dataset, MeshKeys
from texgs.config.gallery import GalleryKeys
from texgs.config.recipes import Edit, Fit
from texgs.core.keys import key
from texgs.models.catalogue import CLIP_BACKBONES
from texgs.volume.view_settings import ViewKeys

NO_SWEEP = "none"  # name of the sweep without variants
ONLY_SEEDS = "seeds"  # name of a sweep over nothing but seeds, and of its only variant


@dataclass(frozen=True)
class Tracking:
    """Where runs are recorded."""

    uri: str | None = key(
        None, "store: sqlite:/// and a file, the address of an MLflow server, or null for none"
    )
    experiment: str = key("texgs", "name of the MLflow experiment")


@dataclass(frozen=True)
class Device:
    """What the work runs on."""

    name: str = key("cpu", "device that the work runs on", choices=("cpu", "cuda"))
    renderer: str = key(
        "cpu", "what renders volumes: the caster, on the CPU or a GPU; or VTK", choices=("cpu", "gpu", "vtk")
    )


@dataclass(frozen=True)
class Metric:
    """Metrics of volumes and edited scenes that need weights or extra time."""

    clip: str = key(
        CLIP_BACKBONES[0],
        "backbone of CLIP's metrics, where its weights are on this machine; losses have their own",
        choices=CLIP_BACKBONES,
    )
    vtk_frames: int = key(
        0, "test views that VTK renders too, to compare times, where offscreen OpenGL works", least=0
    )
    views: int = key(4, "views of the test path that measure style, consistency and CLIP scores", least=1)


@dataclass(frozen=True)
class PageKeys:
    """Scenes of surfels as pages for a browser."""

    made: bool = key(True, "whether each scene and each new look becomes a page, scene.html")


@dataclass(frozen=True)
class Sweep:
    """Variants of an experiment, each with its own overrides, side by side in one table."""

    name: str = key(NO_SWEEP, "name of the sweep and of its table")
    seeds: list[int] = key([0], "seeds of fits; each variant is fitted once with each")
    edit_seeds: list[int] = key([0], "seeds of edits; each edit is made once with each")
    variants: dict[str, list[str]] = key(dict, "overrides by the name of the variant")
    over: list[str] = key(
        [], "keys with several values, such as fit.low_pass=2,6; each combination is a variant"
    )
    edits: list[str] = key(
        [], "edits that are made of each variant, unless `edits=` names some; default those of the experiment"
    )

    @property
    def named(self) -> "Sweep":
        """The sweep with a name, where several seeds alone make it one."""
        is_of_seeds = len(self.seeds) > 1 or len(self.edit_seeds) > 1
        is_nameless = self.name == NO_SWEEP and not self.variants and not self.over
        return replace(self, name=ONLY_SEEDS) if is_nameless and is_of_seeds else self


@dataclass(frozen=True)
class StandIns:
    """Replacements for data sets and edits of an experiment; a replacement may have one itself."""

    taken: str = key("missing", "where data or weights are missing, or always", choices=("missing", "always"))
    datasets: dict[str, str] = key(dict, "data sets by the names of those that they stand in for")
    edits: dict[str, str] = key(dict, "edits by the names of those that they stand in for")

    def of(self, group: Literal["datasets", "edits"], name: str) -> list[str]:
        """Return the replacement of a name, following chains to the end."""
        table, listed = getattr(self, group), [name]
        while (following := table.get(listed[-1], name)) not in listed:
            listed.append(following)
        return listed[1:]


@dataclass(frozen=True)
class Config:
    """Everything."""

    dataset: Dataset = key(Dataset, "the data set")
    datasets: list[str] = key([], "data sets of a whole experiment; default the one of `dataset`")
    experiments: list[str] = key([], "files of conf/experiment that are one run together")
    per_dataset: dict[str, list[str]] = key(
        dict, "overrides that hold for one data set alone, by its name; those of the command win"
    )
    common_overrides: list[str] = key(
        [], "overrides that hold for each of `experiments`, before those of the command"
    )
    on_missing: str = key(
        "stop", "what a run does without data or weights that it needs", choices=("stop", "skip")
    )
    stand_ins: StandIns = key(StandIns, "what is taken in place of the data sets and edits of an experiment")
    tf: str | None = key(None, "basic TF to work on; default each of the data set")
    views: ViewKeys = key(ViewKeys, "training and test views")
    fit: Fit = key(Fit, "recipe of the fit")
    fits: list[str] = key([], "recipes of a whole experiment, files of conf/fit; default the one of `fit`")
    edit: Edit = key(Edit, "a new look for the scene")
    edits: list[str] = key([], "edits of a whole experiment, files of conf/edit; default the one of `edit`")
    metric: Metric = key(Metric, "what edits are measured with")
    mesh: MeshKeys = key(MeshKeys, "surfaces of fits beside those of their volumes")
    page: PageKeys = key(PageKeys, "scenes as pages for a browser")
    gallery: GalleryKeys = key(GalleryKeys, "pictures of scenes side by side")
    sweep: Sweep = key(Sweep, "variants of the experiment")
    sweeps: dict[str, str] = key(
        dict, "sweeps of a whole experiment beside its data sets: the data set of each"
    )
    variant: str = key("", "which of the sweep this is, in the folder of its fits")
    tracking: Tracking = key(Tracking, "where runs are recorded")
    device: Device = key(Device, "what the work runs on")
    data_folder: str = key("data", "folder of data files; or set TEXGS_DATA")
    results: str = key("results", "folder of all results")
