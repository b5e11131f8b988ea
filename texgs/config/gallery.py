"""The schema of galleries, pictures of a data set's scenes in rows and columns, and their cells."""

from dataclasses import dataclass

from texgs.core.keys import key

SECTIONS = ("pse", "relight", "image", "text", "parts", "ablations", "more")  # of the report
NO_EDIT = "none"  # edit of an unedited scene


@dataclass(frozen=True)
class ShotKeys:
    """What the pictures of a row or a column have in common; the column overrides the row.

    Changes of both are made, those of the row first.
    """

    title: str = key("", "title beside the row, or above the column")
    edit: str | None = key(None, f"edit whose scene is shown; {NO_EDIT} or null: the scene as fitted")
    fit: str | None = key(None, "recipe of the scene; default the first of `fits` that the edit works on")
    variant: str | None = key(None, "variant of the sweep whose fits are shown")
    show: str | None = key(
        None,
        "the scene; its volume with the same changes and light; or what is wrong with the scene. A place "
        "where row and column show different things stays empty. Default scene",
        choices=("scene", "volume", "error"),
    )
    view: list[float] = key([], "azimuth and polar angle of the camera; default from the front", "degrees")
    fov_y: float | None = key(
        None, "vertical field of view; default that of the views", "degrees", above=0, below=180
    )
    box: list[float] = key(
        [], "the part of the view that is shown, enlarged: left, top and side, as shares of the view's side"
    )
    pixels: int | None = key(
        None,
        "of each side of the whole view, whose part is enlarged pixel by pixel; default as many as make the "
        "part as large as a picture",
        "pixels",
        least=16,
    )
    light: list[float] = key([], "azimuth and polar angle of the light; default the scene's light", "degrees")
    legend: bool = key(False, "show names, colours and ranges of values in a corner of pictures of the scene")
    changes: list[str] = key([], "changes of the scene, in the words of texgs edit, such as TF01.opacity=0.4")


@dataclass(frozen=True)
class GridKeys:
    """One picture file: rows and columns of pictures."""

    name: str = key("pictures", "name of the file")
    caption: str = key("", "words below it in the report")
    rows: list[ShotKeys] = key([], "rows, from above")
    columns: list[ShotKeys] = key([], "columns, from the left")


@dataclass(frozen=True)
class GalleryKeys:
    """Pictures of a data set's scenes; by default all new looks of the experiment."""

    name: str = key(
        "looks", "name of its folder, and that of fits side by side; as its file in conf/experiment"
    )
    section: str = key("more", "section of the report in which it stands", choices=SECTIONS)
    note: str = key("", "words behind the captions of all pictures, such as what stands in for what")
    size: int = key(400, "width and height of each picture", "pixels", least=16)
    grids: list[GridKeys] = key([], "pictures; default one with a column for each look")


@dataclass
class GalleryCell:
    """Settings of one picture, see `ShotKeys`."""

    scene: str  # its name among the inputs
    show: str  # scene, volume, error, or "" for nothing
    view: list[float]
    fov_y: float | None
    box: list[float]
    pixels: int | None
    light: list[float]
    legend: bool
    changes: list[str]


@dataclass
class GalleryRow:
    """Places side by side."""

    title: str
    pictures: list[GalleryCell]


@dataclass
class Grid:
    """What one file shows."""

    name: str
    caption: str
    columns: list[str]
    rows: list[GalleryRow]
