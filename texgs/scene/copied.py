"""A scene with all of its files in one folder, to keep or to pass on."""

from dataclasses import replace
from pathlib import Path
from shutil import copyfile
from typing import TypeVar

from texgs.core.names import file_name
from texgs.scene.scene import Scene, SceneModel, SceneSegment
from texgs.scene.scene_file import write_scene
from texgs.scene.series_file import Series, write_series
from texgs.volume import summaries

Entry = TypeVar("Entry", SceneModel, SceneSegment)
SCENE = "scene.yaml"


def write_copy(folder: str | Path, scene: Scene) -> Path:
    """Copy models, textures, segments and the volume into a folder, and write scene.yaml there; return it.

    Files are named after parts, those of the same names are replaced, and others stay.
    """
    copies = Copies(Path(folder))
    models = {}
    for name, model in scene.models.items():
        segments = {key: copies.entry(each, name, key) for key, each in model.segments.items()}
        models[name] = replace(copies.entry(model, name), segments=segments)
    series = scene.series and copies.series(scene.series)
    volume = scene.volume and replace(scene.volume, file=copies.volume(scene.volume.file))
    return write_scene(copies.folder / SCENE, replace(scene, models=models, volume=volume, series=series))


class Copies:
    """Files that are copied into a folder, each once."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._copies = folder, dict[Path, Path]()
        folder.mkdir(parents=True, exist_ok=True)

    def entry(self, entry: Entry, *names: str) -> Entry:
        """Return a model or a segment with copies of its file and its texture."""
        texture = entry.texture and self.copy(entry.texture, *names, "texture")
        return replace(entry, file=self.copy(entry.file, *names), texture=texture)

    def volume(self, file: Path) -> Path:
        """Return the copy of a volume, with what is known of its values beside it."""
        summary = file.with_name(summaries.FILE)
        if summary.exists():
            self.copy(summary, summary.stem)
        return self.copy(file, "volume")

    def series(self, series: Series) -> Series:
        """Return the series with copies of its volumes and steps of models."""
        copied = replace(series, file=self.folder / series.file.name)
        for step in range(len(series.steps)):
            for name in series.models:
                self.copy(series.model(name, step), copied.model(name, step).stem)
            self.copy(series.volume(step), copied.volume(step).stem)
        write_series(copied)
        return copied

    def copy(self, file: Path, *names: str) -> Path:
        """Return the copy of a file, which has these names and its ending."""
        source = file.resolve()
        if source not in self._copies:
            target = self.folder / file_name("part", f"{'-'.join(names)}{file.suffix}".replace("/", "-"))
            if target.resolve() != source:
                copyfile(source, target)
            self._copies[source] = target
        return self._copies[source]
