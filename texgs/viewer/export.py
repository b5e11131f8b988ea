"""A scene, or one model of it, as a file for other programs, or as a page for a browser."""

from pathlib import Path

from texgs.fields.files import kind_of
from texgs.scene.export import require_export, require_other, single_model, write_export
from texgs.scene.export_keys import Export
from texgs.scene.scene import Scene
from texgs.viewer.page_volume import page_volume
from texgs.viewer.standalone import write_page


def export(path: Path, scene: Scene, keys: Export, checked: str = "", name: str = "") -> list[str]:
    """Write a file, and return notes on it, in sentences.

    Args:
        path: of the file, whose ending says what it is, where the keys do not.
        scene: to write.
        keys: what, and how.
        checked: what `texgs check` has found of the scene, which a page says.
        name: of a page, its title; default that of the file.

    Raises:
        ArgumentError, ShapeError: if the scene cannot be written so, or an option does not count.
    """
    if keys.kind_of(path) != "html":
        return write_export(path, scene, keys)
    shown = single_model(scene, keys.model)
    require_other(path, scene)
    for entry in shown.models.values():
        require_export(kind_of(entry.file), "html")
    volume = None if keys.volume is None else page_volume(shown, keys.volume)
    page = write_page(path, shown, name or path.stem, checked, volume, keys.steps)
    bare = shown.cuts and shown.volume and volume is None
    cuts = "without faces, which need the volume, too (--volume)" if bare else None
    told = {"Volume": volume, "Series": page.steps, "Light": page.light, "Cuts": cuts}
    return [f"{title} in the page: {what}" for title, what in told.items() if what is not None]
