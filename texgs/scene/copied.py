"""Copy a scene with all its files into one folder, to keep or to share."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from filecmp import cmp
from itertools import count
from pathlib import Path
from typing import TypeVar

from texgs.core.errors import ArgumentError
from texgs.core.io import copy_atomic
from texgs.core.names import METRICS, SCENE, file_name
from texgs.scene.scene import Scene, SceneModel, SceneSegment
from texgs.scene.scene_file import write_scene
from texgs.scene.series_file import Series, write_series
from texgs.scene.session import files_of
from texgs.volume.summaries import summary_file

Entry = TypeVar("Entry", SceneModel, SceneSegment)


def write_copy(folder: str | Path, scene: Scene) -> Path:
    """Copy models, textures, segments and the volume into a folder, and write scene.yaml there; return it.

    Files are named after parts. A file of that name with other contents stays, as steps that can be undone or
    other scenes may need it, and the copy gets a number; only scene.yaml and the files of a series are
    replaced.

    Raises:
        ArgumentError: if the folder cannot be made or is a result of the workflow, or a file of the scene is
            gone.
    """
    if (Path(folder) / METRICS).exists():
        raise ArgumentError(
            f"{folder}: expected a folder of your own, got a result of the workflow, whose next run makes it "
            "anew; choose another"
        )
    require_files([*files_of(scene), scene.volume.file if scene.volume else None])
    copies, models = Copies(Path(folder)), {}
    series = scene.series and copies.series(scene.series)
    for name, model in scene.models.items():
        segments = {key: copies.entry(each, name, key) for key, each in model.segments.items()}
        models[name] = replace(copies.entry(model, name), segments=segments)
    volume = scene.volume and replace(scene.volume, file=copies.volume(scene.volume.file))
    return write_scene(copies.folder / SCENE, replace(scene, models=models, volume=volume, series=series))


def require_files(files: Iterable[Path | None]) -> None:
    """Require that the files of a scene exist; None stands for no file."""
    if gone := [file for file in files if file is not None and not file.exists()]:
        raise ArgumentError(f"{gone[0]}: no such file, which the scene needs; bring it back, then try again")


class Copies:
    """Copies files into a folder, each once."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._copies = folder, dict[Path, Path]()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ArgumentError(
                f"{folder}: expected a folder, but it cannot be made ({error.strerror})"
            ) from error

    def entry(self, entry: Entry, *names: str) -> Entry:
        """Return a model or a segment with copies of its file and its texture."""
        texture = entry.texture and self.copy(entry.texture, *names, "texture")
        return replace(entry, file=self.copy(entry.file, *names), texture=texture)

    def volume(self, file: Path) -> Path:
        """Copy a volume together with its summary."""
        return self.with_summary(file, self.copy(file, "volume"))

    def with_summary(self, file: Path, target: Path) -> Path:
        """Copy a volume after its summary, if any; return the copy."""
        if (summary := summary_file(file)).exists():
            self.put(summary, summary_file(target))
        return target

    def series(self, series: Series) -> Series:
        """Return the series with copies of its volumes and steps of models."""
        copied = replace(series, file=self.folder / series.file.name)
        for step in range(len(series.steps)):
            for name in series.models:
                self.put(series.model(name, step), copied.model(name, step))
            self.with_summary(series.volume(step), self.put(series.volume(step), copied.volume(step)))
        write_series(copied)
        return copied

    def copy(self, file: Path, *names: str) -> Path:
        """Copy a file under a name made of these names, a number if needed, and its suffix."""
        source = file.resolve()
        if source not in self._copies:
            free = (each for each in self.targets(file.suffix, names) if self.is_free(each, source))
            self.put(source, next(free))
        return self._copies[source]

    def targets(self, suffix: str, names: tuple[str, ...]) -> Iterator[Path]:
        """Yield files of these names: without a number, with 2, with 3 ..."""
        for number in count(1):
            words = "-".join([*names, *([str(number)] if number > 1 else [])])
            yield self.folder / file_name("part", f"{words}{suffix}".replace("/", "-"))

    def is_free(self, target: Path, source: Path) -> bool:
        """Return whether no other file has this name, in the folder or among the copies."""
        if target in self._copies.values():
            return False
        return not target.exists() or target.samefile(source) or cmp(target, source, shallow=False)

    def put(self, source: Path, target: Path) -> Path:
        """Copy a file unless the same is there already; return the copy."""
        if target.resolve() != source.resolve():
            copy_atomic(source, target)
        self._copies[source.resolve()] = target
        return target
