"""Where the jobs of the workflow put their files, below the folder of results: all paths, in one place."""

from dataclasses import dataclass
from pathlib import Path

from omegaconf import DictConfig

from texgs.workflow.variants import edit_variant, fit_variant


@dataclass(frozen=True)
class Place:
    """The folder of a job, and the files in it that other jobs and people read."""

    folder: str  # of wildcards dataset, tf, views, fit, phase, edit and gallery
    files: tuple[str, ...] = ()  # the first is the one that other jobs ask for; metrics.json comes with all

    @property
    def is_per_tf(self) -> bool:
        """Whether there is a job for each basic TF, not for the whole data set."""
        return "{tf}" in self.folder


PLACES = {
    "volume": Place("{dataset}/volume", ("volume.nrrd", "volume.json")),
    "transfer": Place("{dataset}/transfer", ("transfer.png",)),
    "views": Place(
        "{dataset}/{tf}/{views}", ("transforms_train.json", "transforms_test.json", "turntable.png")
    ),
    "sheet": Place("{dataset}/{tf}/sheet", ("sheet.png",)),
    "phase": Place("{dataset}/{tf}/{fit}/{phase}", ("model.safetensors",)),
    "comparison": Place("{dataset}/{tf}/comparison/{gallery}", ("comparison.png",)),
    "figure": Place("{dataset}/{tf}/{fit}/figure", ("figure.png",)),
    "mesh": Place("{dataset}/{tf}/{fit}/mesh", ("mesh.ply", "reference.ply", "mesh.png")),
    "compose": Place("{dataset}/scene/{fit}/compose", ("scene.yaml", "scene.png")),
    "pse": Place("{dataset}/scene/{fit}/pse", ("pse.png", "relight.png")),
    "timing": Place("{dataset}/scene/{fit}/timing"),
    "page": Place("{dataset}/scene/{fit}/pages/{edit}", ("scene.html", "poster.jpg")),
    "gallery": Place("{dataset}/gallery/{gallery}"),
    "edit": Place("{dataset}/scene/{fit}/edits/{edit}", ("scene.yaml", "edit.png")),
    "edit_metrics": Place("{dataset}/scene/{fit}/edit_metrics/{edit}"),
}


def folder_of(place: str, config: DictConfig, phase: str = "", tf: str | None = None) -> Path:
    """Folder of a job's files; `tf`: of another basic TF than `config.tf`."""
    return Path(config.results) / PLACES[place].folder.format(
        dataset=config.dataset.name,
        tf=tf or config.tf,
        views=config.views.name,
        fit=fit_folder(config),
        phase=phase,
        edit=edit_folder(config),
        gallery=config.gallery.name,
    )


def made(place: str, config: DictConfig, phase: str = "", tf: str | None = None) -> Path:
    """The file of a job that other jobs ask for."""
    return folder_of(place, config, phase, tf) / PLACES[place].files[0]


def fit_folder(config: DictConfig) -> str:
    """Name of the folder of a fit: the recipe, the variant of a sweep, and a seed other than 0."""
    return _folder(config.fit.name, fit_variant(config), config.fit.seed)


def edit_folder(config: DictConfig, name: str = "") -> str:
    """Name of the folder of an edit in the same way; `name`: of another edit than that of `config`."""
    return _folder(name or config.edit.name, edit_variant(config), config.edit.seed)


def _folder(name: str, variant: str, seed: int) -> str:
    return "-".join(filter(None, (name, variant, f"s{seed}" if seed else "")))
