"""Messages of a page to its server, in JSON, checked before anything uses them."""

import json
from dataclasses import dataclass
from typing import Any, Literal, get_args

from texgs.core.camera import Camera, orbit
from texgs.core.errors import ArgumentError
from texgs.core.keys import REQUIRED, ValueMismatch, key, mismatch, typed
from texgs.scene.shot import Mode

PageMode = Literal[Mode, "truth", "difference", "wipe"]  # the volume, the scene's difference from it, or both
MESSAGE_BYTES = 1 << 22  # at most; most messages have a few hundred, 32 functions of ParaView have 400,000
LARGEST_ID = 2**53  # JavaScript cannot tell larger ones from the next
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
        """Return the camera, with scaled sides."""
        width, height = (max(1, round(scale * side)) for side in (self.width, self.height))
        return orbit(self.azimuth, self.polar, self.distance, self.fov_y, width, height, self.target)


@dataclass(frozen=True)
class View:
    """Show a frame."""

    camera: Orbit
    id: int = key(0, "comes back with the frame", least=0, most=LARGEST_ID)
    mode: PageMode = "shaded"
    gain: float = key(4.0, "of differences", least=1, most=16)
    wipe: float | None = key(None, "share of the width; default: beside it", least=0, most=1)
    moving: bool = False  # more views follow: speed counts more than quality
    before: bool = False  # the scene as it was opened
    legend: bool = False  # of the scene, in a picture that is saved
    transparent: bool = False  # without background; of the scene or its volume alone
    only: str = ""  # a model to show alone and unedited, for clicks


@dataclass(frozen=True)
class Pick:
    """Find the point of the scene that a pixel of a view shows."""

    view: View
    pixel: tuple[int, int] = key(REQUIRED, "to the right and down", "pixels", least=0, most=LARGEST_SIDE - 1)
    id: int = key(0, "comes back with the point", least=0, most=LARGEST_ID)


@dataclass(frozen=True)
class Slice:
    """Ask for a slice of the volume."""

    plane: int = key(REQUIRED, "across x, y or z of the file's space", least=0, most=2)
    number: int = key(REQUIRED, "of the slice")
    window: tuple[float, float] = key(REQUIRED, "values in black and in white")


@dataclass(frozen=True)
class Place:
    """Ask what is at a place of the volume."""

    point: tuple[float, float, float] = key(REQUIRED, "of the world", "world units", least=-1e6, most=1e6)


@dataclass(frozen=True)
class Edit:
    """Change one value of a part, or of the scene where the part is empty."""

    part: str  # MODEL or MODEL/SEGMENT
    key: str  # of a `PartEdit`; of `SCENE_KEYS` for the scene
    value: Any = None  # as in a scene file; None takes the edit back
    step: int = 0  # edits in a row with the same number, such as those of a slider, are one step
    title: str = ""  # of the step in the history


@dataclass(frozen=True)
class Undo:
    """Take the latest step back."""


@dataclass(frozen=True)
class Redo:
    """Make the last undone step again."""


@dataclass(frozen=True)
class Save:
    """Write the scene file."""

    name: str  # of the file, in the folder for saving
    replace: bool = False  # an existing file


@dataclass(frozen=True)
class Clicked:
    """Clicks on a view of a model alone: pixels x, y, and whether they are on the object."""

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
    sphere: bool = False  # the picture shows a lit sphere: normals find their colours in it
    hue: float = key(1.0, "how far it may leave the functions' hues, see `ReadableKeys`", least=0, most=1)
    preview: bool = False  # show the look on this page alone, and change nothing
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
    view: View  # that is shown
    keys: tuple[dict[str, Any], ...] = key((), "of a film, see `read_keys`", items=(0, 20))
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
    """Stop the job that is at work, and take the preview off."""

    preview: bool = False  # the preview alone; the job goes on


Job = Segment | Look | Fit | Keep | Export  # takes a while; only one is at work
Message = View | Pick | Edit | Undo | Redo | Save | Mask | Job | Rename | Remove | Cancel
MESSAGES: dict[str, type[Message]] = {kind.__name__.lower(): kind for kind in get_args(Message)}


def parse(text: str | bytes, kind: type[Any] | None = None) -> Any:
    """Return the message in a text, of any kind or of a given one.

    Raises:
        ArgumentError: if it is none; says which key, what was expected and what there was.
    """
    try:
        values = json.loads(text)
        if not isinstance(values, dict):
            raise mismatch("message", "keys with values in JSON", values)
        kinds = MESSAGES if kind is None else {kind.__name__.lower(): kind}
        name = values.pop("type", kind and kind.__name__.lower())
        if not isinstance(name, str) or name not in kinds:
            raise mismatch("type", f"one of {', '.join(kinds)}", name)
        return typed(kinds[name], values)
    except ValueMismatch as error:
        raise ArgumentError(str(error)) from error
    except (ValueError, RecursionError) as error:
        raise ArgumentError(f"message: expected keys with values in JSON, got {text[:100]!r}") from error
