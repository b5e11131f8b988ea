"""Where the data of a data set are on this machine, and its basic TFs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from texgs.config.dataset import BasicTF, Volume
from texgs.core.cache import cache_folder
from texgs.core.errors import ConfigError, MissingDataError
from texgs.core.io import is_there
from texgs.core.names import file_name

if TYPE_CHECKING:
    from texgs.config.schema import Config


def source_file(config: Config) -> Path | None:
    """The volume's file, or folder of slices; None if it is generated.

    A file that can be downloaded may be still to come.

    Raises:
        MissingDataError: if it is not there and cannot be downloaded; says how to get it.
    """
    dataset, volume = config.dataset, config.dataset.volume
    if dataset.views_folder is not None:
        raise ConfigError(
            f"data set {dataset.name}: starts from views, it has no volume; texgs sheet shows them"
        )
    if (volume.generator is None) == (volume.file is None):
        raise ConfigError(
            f"dataset.volume of {dataset.name}: expected a generator or a file, "
            f"got {'neither' if volume.file is None else 'both'}"
        )
    if volume.file is None:
        return None
    path = Path(config.data_folder, volume.file)
    if is_there(path):
        return path
    if volume.url:
        return cached_volume(volume)
    raise MissingDataError(
        f"data set {dataset.name}: {path} is not there; {volume.obtain or 'put it there'}, "
        "or name its folder with data_folder=FOLDER or TEXGS_DATA"
    )


def cached_volume(volume: Volume) -> Path:
    """Where a volume's file is downloaded to; another checksum is another file.

    Raises:
        ConfigError: if there is no checksum to compare it with.
    """
    checksum, name = volume.sha256, file_name("dataset.volume.file", Path(volume.file or "").name)
    if not checksum or not checksum.isalnum():
        raise ConfigError(
            f"dataset.volume.sha256: expected the checksum of {volume.url}, got {checksum or 'none'}"
        )
    return cache_folder() / "volumes" / checksum[:12] / name


def views_folder(config: Config, tf: str | None = None) -> Path | None:
    """Folder of the views that a data set without volume starts from; None for one with a volume.

    By default that of `config.tf`.
    """
    if config.dataset.views_folder is None:
        return None
    folder = Path(config.data_folder, config.dataset.views_folder, tf or config.tf or "")
    if not (folder / "transforms_train.json").is_file():
        raise MissingDataError(
            f"data set {config.dataset.name}: no views in {folder}; "
            f"{config.dataset.volume.obtain or 'put them there, with a file transforms_train.json'}, "
            "or name the folder above with data_folder=FOLDER or TEXGS_DATA"
        )
    return folder


def basic_tf(config: Config) -> BasicTF:
    """The basic TF that `config.tf` names."""
    known = config.dataset.basic_tfs
    if config.tf not in known:
        names = ", ".join(known) or "none"
        raise ConfigError(
            f"tf: expected a basic TF of data set {config.dataset.name} ({names}), got {config.tf}"
        )
    return known[config.tf]


def tf_names(config: Config) -> list[str]:
    """The basic TFs to work on: the one chosen, else all of the data set; those of views are its subfolders.

    Raises:
        ConfigError: if there are none, or not the one chosen.
        MissingDataError: if there is no folder of views.
    """
    from texgs.config.check import check_name  # not at the top: it loads Hydra

    if config.tf is not None:
        if config.dataset.views_folder is None:
            basic_tf(config)
        return [config.tf]
    names = list(config.dataset.basic_tfs)
    if not names and config.dataset.views_folder is not None:
        folder = Path(config.data_folder, config.dataset.views_folder)
        names = sorted(path.parent.name for path in folder.glob("*/transforms_train.json"))
        for name in names:
            check_name(f"folder of views in {folder}", name)
        if not names:
            raise MissingDataError(
                f"data set {config.dataset.name}: no folder of views in {folder}; "
                f"{config.dataset.volume.obtain or 'put one there per basic TF'}, "
                "or name the folder above with data_folder=FOLDER or TEXGS_DATA"
            )
    if not names:
        raise ConfigError(f"data set {config.dataset.name}: expected at least one basic TF, got none")
    return names
