"""What a page says to its server."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from texgs.core.camera import Camera, orbit
from texgs.scene.frame import Mode

OfViews = Literal["truth", "difference"]
OF_VIEWS = get_args(OfViews)  # modes that show the training view nearest to the camera
MODES = (*get_args(Mode), *OF_VIEWS)
LARGEST = 1 << 16  # bytes of a message; a page's own have a few hundred


@dataclass(frozen=True)
class Orbit:
    """A camera that looks at a target, as `texgs.core.camera.orbit` has it."""

    target: tuple[float, float, float]  # world units
    azimuth: float  # degrees
    polar: float  # degrees above the horizon
    distance: float  # world units
    fov_y: float  # degrees
    width: int  # pixels
    height: int  # pixels

    def camera(self, scale: float = 1.0) -> Camera:
        """The camera, with sides of this part of the pixels."""
        width, height = (max(1, round(scale * side)) for side in (self.width, self.height))
        return orbit(self.azimuth, self.polar, self.distance, self.fov_y, width, height, self.target)


@dataclass(frozen=True)
class View:
    """Show a frame."""

    id: int  # comes back with the frame
    camera: Orbit
    mode: Mode | OfViews
    moving: bool  # another one follows at once: speed counts more than quality
    before: bool  # the scene as it was opened
    only: str = ""  # a model that is shown alone and unedited, to be clicked on


@dataclass(frozen=True)
class Edit:
    """Change one value of a part, or of the scene where the part is empty."""

    part: str  # MODEL or MODEL/SEGMENT
    key: str  # of a `PartEdit`; "light" or "background" of the scene
    value: Any  # as in a scene file; None takes the edit back
    step: int  # edits of one number in a row are one step of the history, such as those of a slider

    @property
    def title(self) -> str:
        """What the list of steps calls it, once it has been made."""
        return f"{self.part} {self.key} {title_of_value(self.value)}".strip()


@dataclass(frozen=True)
class Undo:
    """Take the latest step back."""


@dataclass(frozen=True)
class Redo:
    """Make the step again that was taken back last."""


@dataclass(frozen=True)
class Save:
    """Write the scene file."""

    name: str  # of the file, in the folder for saving
    replace: bool  # a file that is there already


@dataclass(frozen=True)
class Clicked:
    """Clicks on a view of a model alone."""

    camera: Orbit
    points: tuple[
        tuple[float, float, bool], ...
    ]  # pixels to the right and down, and whether it is on the object


@dataclass(frozen=True)
class Mask:
    """Show what clicks select."""

    id: int  # comes back with the mask
    model: str
    clicked: Clicked


@dataclass(frozen=True)
class Segment:
    """Make a segment of what clicks select."""

    part: str  # MODEL/SEGMENT, a new name
    clicked: Clicked


@dataclass(frozen=True)
class Look:
    """Give parts a new look, by a picture or by an instruction."""

    parts: tuple[str, ...]  # none: all models
    style: str  # name of a picture; "" with an instruction
    instruction: str  # "" with a picture
    is_preview: bool  # show what it would be like, and change nothing


@dataclass(frozen=True)
class Export:
    """Write a file for the page to save."""

    kind: str  # mp4 or gif, a turntable; html; or as `texgs.scene.export_file.Export` has it
    view: View  # that a turntable begins with


@dataclass(frozen=True)
class Rename:
    """Give a segment another name."""

    part: str  # MODEL/SEGMENT
    name: str  # of the segment


@dataclass(frozen=True)
class Remove:
    """Give the surfels of a segment back to its model."""

    part: str  # MODEL/SEGMENT


@dataclass(frozen=True)
class Cancel:
    """Stop the job that is at work, and show no preview any more."""

    only_preview: bool = False  # the job goes on


def title_of_value(value: Any) -> str:
    """A value of an edit in few letters: #rrggbb, angles, a number."""
    if value is None:
        return "reset"
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {angle:.0f}°" for key, angle in value.items())
    if isinstance(value, list):
        return "#" + "".join(f"{round(255 * x):02x}" for x in value)
    return value if isinstance(value, str) else f"{value:.4g}"


Message = View | Edit | Undo | Redo | Save | Mask | Segment | Look | Export | Rename | Remove | Cancel
