"""What a page says to its server: messages in JSON, checked before anything uses them."""

import json
from dataclasses import dataclass
from typing import Any, Literal, get_args

from texgs.core.camera import Camera, orbit
from texgs.core.errors import ArgumentError
from texgs.core.keys import REQUIRED, ValueMismatch, key, mismatch, typed
from texgs.scene.shot import Mode

Shown = Literal[Mode, "truth", "difference", "wipe"]  # the volume, the scene's difference from it, or both
LARGEST = 1 << 22  # bytes of a message; most have a few hundred, 32 functions of ParaView 400,000
LARGEST_ID = 2**53  # that JavaScript tells from the next number
LARGEST_SIDE = 4096  # pixels


@dataclass(frozen=True)
class Orbit:
    """A camera that looks at a target, as `texgs.core.camera.orbit` has it."""

    target: tuple[float, float, float] = key(REQUIRED, "its centre", "world units", least=-1e6, most=1e6)
    azimuth: float = key(REQUIRED, "around the target", "degrees", least=-1e6, most=1e6)
    polar: float = key(REQUIRED, "above the horizon", "degrees", least=-90, most=90)
    distance: float = key(REQUIRED, "from the target", "world units", least=1e-6, most=1e6)
    fov_y: float = key(REQUIRED, "vertical field of view", "degrees", least=1, most=150)
    width: int = key(REQUIRED, "of a frame", "pixels", least=1, most=LARGEST_SIDE)
    height: int = key(REQUIRED, "of a frame", "pixels", least=1, most=LARGEST_SIDE)

    def camera(self, scale: float = 1.0) -> Camera:
        """Return the camera, with sides of this part of the pixels."""
        width, height = (max(1, round(scale * side)) for side in (self.width, self.height))
        return orbit(self.azimuth, self.polar, self.distance, self.fov_y, width, height, self.target)


@dataclass(frozen=True)
class View:
    """Show a frame."""

    camera: Orbit
    id: int = key(0, "comes back with the frame", least=0, most=LARGEST_ID)
    mode: Shown = "shaded"
    gain: float = key(4.0, "of differences", least=1, most=16)
    wipe: float | None = key(None, "share of the width; default: beside it", least=0, most=1)
    moving: bool = False  # another one follows at once: speed counts more than quality
    before: bool = False  # the scene as it was opened
    transparent: bool = False  # without its background; of pictures of the scene or its volume alone
    only: str = ""  # a model that is shown alone and unedited, to be clicked on


@dataclass(frozen=True)
class Pick:
    """Tell which point of the scene a pixel of a view shows."""

    view: View
    pixel: tuple[int, int] = key(REQUIRED, "to the right and down", "pixels", least=0, most=LARGEST_SIDE - 1)


@dataclass(frozen=True)
class Edit:
    """Change one value of a part, or of the scene where the part is empty."""

    part: str  # MODEL or MODEL/SEGMENT
    key: str  # of a `PartEdit`; of `SCENE_KEYS` for the scene
    value: Any = None  # as in a scene file; None takes the edit back
    step: int = 0  # edits of one number in a row are one step of the history, such as those of a slider
    title: str = ""  # of the step in the history


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
    replace: bool = False  # a file that is there already


@dataclass(frozen=True)
class Clicked:
    """Clicks on a view of a model alone: pixels to the right and down, and whether they are on the object."""

    camera: Orbit
    points: tuple[tuple[float, float, bool], ...] = key(
        REQUIRED, "clicks", "pixels", items=(0, 100), least=-LARGEST_SIDE, most=2 * LARGEST_SIDE
    )
    outline: tuple[tuple[float, float], ...] | None = key(
        None, "around the object", "pixels", items=(3, 500), least=-LARGEST_SIDE, most=2 * LARGEST_SIDE
    )


@dataclass(frozen=True)
class Mask(Clicked):
    """Show what clicks select."""

    model: str = key(REQUIRED, "which is clicked on")
    id: int = key(0, "comes back with the mask", least=0, most=LARGEST_ID)


@dataclass(frozen=True)
class Segment(Clicked):
    """Make a segment of what clicks select."""

    part: str = key(REQUIRED, "MODEL/SEGMENT, a new name")


@dataclass(frozen=True)
class Look:
    """Give parts a new look, by a picture or by an instruction."""

    parts: tuple[str, ...] = key((), "none: all models", items=(0, 1000))
    style: str = ""  # name of a picture; "" with an instruction
    instruction: str = ""  # "" with a picture
    sphere: bool = False  # the picture is of a lit sphere, and goes onto surfaces by their normals
    preview: bool = False  # show on this page what it would be like, and change nothing
    camera: Orbit | None = None  # of a thumbnail; or the side from which words are previewed, all by default


@dataclass(frozen=True)
class Fit:
    """Fit a model of a function that the scene tries."""

    function: str


@dataclass(frozen=True)
class Keep:
    """Write a function into the file of its data set."""

    function: str


@dataclass(frozen=True)
class Export:
    """Write a file for the page to save."""

    kind: str  # of `exports_of`
    view: View  # that a turntable begins with
    stops: tuple[Orbit, ...] = key((), "of a film; of fewer than 2, a turntable", items=(0, 20))
    seconds: float = key(2.88, "length of a film", "seconds", least=0.1, most=600)
    fps: float = key(25.0, "of a film", "frames per second", least=1, most=240)
    steps: str = "all"  # of a series, in a page; see `page_steps`


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

    preview: bool = False  # the preview alone; the job goes on


Making = Mask | Segment | Look | Fit | Keep | Export
Message = View | Pick | Edit | Undo | Redo | Save | Making | Rename | Remove | Cancel
MESSAGES: dict[str, type[Message]] = {kind.__name__.lower(): kind for kind in get_args(Message)}


def parse(text: str | bytes, kind: type[Any] | None = None) -> Any:
    """Return the message that a text holds, of any kind or of this one.

    Raises:
        ArgumentError: if it is none; says which key, what was expected and what there was.
    """
    try:
        values = json.loads(text)
        if not isinstance(values, dict):
            raise mismatch("message", "keys with values in JSON", values)
        name = values.pop("type", kind and kind.__name__.lower())
        wanted = MESSAGES.get(name) if isinstance(name, str) else None
        if wanted is None or kind not in (None, wanted):
            raise mismatch("type", f"one of {', '.join(MESSAGES)}", name)
        return typed(wanted, values)
    except ValueMismatch as error:
        raise ArgumentError(str(error)) from error
    except (ValueError, RecursionError) as error:
        raise ArgumentError(f"message: expected keys with values in JSON, got {text[:100]!r}") from error
