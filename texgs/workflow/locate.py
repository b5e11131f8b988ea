"""Where the data of a data set are on this machine, and its basic TFs."""

from pathlib import Path

from texgs.config.dataset import Dataset
from texgs.config.project import check_name
from texgs.config.schema import Config
from texgs.core.errors import ArgumentError, ConfigError, MissingDataError, errors_at
from texgs.core.io import is_there
from texgs.volume.basic_tfs import BasicTF
from texgs.volume.moments import in_time, matching
from texgs.volume.settings import cached_volume


def require_volume(dataset: Dataset) -> None:
    """Require a data set that starts from a volume."""
    if dataset.views_folder is not None:
        raise ConfigError(
            f"data set {dataset.name}: starts from views, it has no volume; texgs sheet shows them"
        )


def source_file(config: Config) -> Path | None:
    """Return the volume's file, or folder of slices; None if it is generated.

    A file that can be downloaded may be still to come; for others MissingDataError says how to get them.
    """
    dataset, volume = config.dataset, config.dataset.volume
    require_volume(dataset)
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
    raise missing(config, f"{path} is not there; {volume.obtain or 'put it there'}", "its folder")


def labels_file(config: Config) -> Path | None:
    """Return the file of labels beside the image of a data set; None where it has none."""
    if config.dataset.volume.labels is None:
        return None
    path = Path(config.data_folder, config.dataset.volume.labels)
    if not path.is_file():
        raise missing(config, f"dataset.volume.labels: {path} is not there; put it there", "its folder")
    return path


def series_files(config: Config) -> list[Path]:
    """Return files or folders of the steps of a data set's series, in order; none where it has none.

    MissingDataError tells which are not there. Where there are several, the volume has to be one of them.
    """
    name, own = config.dataset.name, source_file(config)
    try:
        files = matching(Path(config.data_folder, each) for each in config.dataset.series)
    except ArgumentError as error:
        raise missing(config, f"dataset.series: {error}; put them there") from error
    if len(files) < 2:
        return files
    if own not in files:
        raise ConfigError(
            f"dataset.series of {name}: expected volume.file to be one of them, got {own} beside "
            f"{files[0]} to {files[-1].name}"
        )
    with errors_at(f"dataset.series of {name}"):
        return [moment.file for moment in in_time(files) if moment.file]


def views_folder(config: Config, tf: str | None = None) -> Path | None:
    """Return the folder of the views, by default of `config.tf`, that a data set without volume starts from.

    One with a volume has none.
    """
    if config.dataset.views_folder is None:
        return None
    folder = Path(config.data_folder, config.dataset.views_folder, tf or config.tf or "")
    if not (folder / "transforms_train.json").is_file():
        how = config.dataset.volume.obtain or "put them there, with a file transforms_train.json"
        raise missing(config, f"no views in {folder}; {how}")
    return folder


def missing(config: Config, why: str, folder: str = "the folder above") -> MissingDataError:
    """Return the error for data that are not there."""
    return MissingDataError(
        f"data set {config.dataset.name}: {why}, or name {folder} with data_folder=FOLDER or TEXGS_DATA"
    )


def basic_tf(config: Config) -> BasicTF:
    """Return the basic TF that `config.tf` names."""
    known = config.dataset.basic_tfs
    if config.tf not in known:
        names = ", ".join(known) or "none"
        raise ConfigError(
            f"tf: expected a basic TF of data set {config.dataset.name} ({names}), got {config.tf}"
        )
    return known[config.tf]


def tf_names(config: Config) -> list[str]:
    """Return the basic TFs to work on: the one chosen, else all of the data set.

    Those of views are its subfolders; MissingDataError says how to get these.
    """
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
            how = config.dataset.volume.obtain or "put one there per basic TF"
            raise missing(config, f"no folder of views in {folder}; {how}")
    if not names:
        raise ConfigError(f"data set {config.dataset.name}: expected at least one basic TF, got none")
    return names
