"""What a page says to its server: messages in JSON, checked before anything uses them."""

from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any, Literal, get_args

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from texgs.core.camera import Camera, orbit
from texgs.core.errors import ArgumentError
from texgs.scene.frame import Mode

Compared = Literal["truth", "difference", "wipe"]  # the volume, the scene's difference from it, or both
LARGEST = 1 << 22  # bytes of a message; most have a few hundred, 32 functions of ParaView 400,000
MOST_POINTS, MOST_CORNERS = 100, 500
MOST_PARTS = 1000
STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

Number = Annotated[int, Field(ge=0, le=2**53)]  # that comes back with what was asked for
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Pixels = Annotated[int, Field(ge=1, le=4096)]
Place = Annotated[int, Field(ge=0, lt=4096)]  # of a pixel
Spot = Annotated[float, Field(ge=-4096, le=8192)]  # in pixels, to the right or down
Click = tuple[Spot, Spot, bool]
Outline = Annotated[tuple[tuple[Spot, Spot], ...], Field(min_length=3, max_length=MOST_CORNERS)]


def tag(name: str) -> Any:
    """Return the field that says which message this is."""
    return field(default=name, kw_only=True)


@dataclass(frozen=True, config=STRICT)
class Orbit:
    """A camera that looks at a target, as `texgs.core.camera.orbit` has it."""

    target: tuple[Coordinate, Coordinate, Coordinate]  # world units
    azimuth: Coordinate  # degrees
    polar: Annotated[float, Field(ge=-90, le=90)]  # degrees above the horizon
    distance: Annotated[float, Field(ge=1e-6, le=1e6)]  # world units
    fov_y: Annotated[float, Field(ge=1, le=150)]  # degrees
    width: Pixels
    height: Pixels

    def camera(self, scale: float = 1.0) -> Camera:
        """Return the camera, with sides of this part of the pixels."""
        width, height = (max(1, round(scale * side)) for side in (self.width, self.height))
        return orbit(self.azimuth, self.polar, self.distance, self.fov_y, width, height, self.target)


@dataclass(frozen=True, config=STRICT)
class View:
    """Show a frame."""

    camera: Orbit
    id: Number = 0  # comes back with the frame
    mode: Mode | Compared = "shaded"
    gain: Annotated[float, Field(ge=1, le=16)] = 4.0  # of differences
    wipe: Annotated[float, Field(ge=0, le=1)] | None = None  # share of the width; none: beside it
    moving: bool = False  # another one follows at once: speed counts more than quality
    before: bool = False  # the scene as it was opened
    transparent: bool = False  # without its background; of pictures of the scene or its volume alone
    only: str = ""  # a model that is shown alone and unedited, to be clicked on
    type: Literal["view"] = tag("view")


@dataclass(frozen=True, config=STRICT)
class Pick:
    """Tell which point of the scene a pixel of a view shows."""

    view: View
    pixel: tuple[Place, Place]  # to the right and down
    type: Literal["pick"] = tag("pick")


@dataclass(frozen=True, config=STRICT)
class Edit:
    """Change one value of a part, or of the scene where the part is empty."""

    part: str  # MODEL or MODEL/SEGMENT
    key: str  # of a `PartEdit`; of `SCENE_KEYS` for the scene
    value: Any = None  # as in a scene file; None takes the edit back
    step: Number = 0  # edits of one number in a row are one step of the history, such as those of a slider
    type: Literal["edit"] = tag("edit")

    @property
    def title(self) -> str:
        """Return what the list of steps calls it, once it has been made."""
        if self.value is not None and self.key in ("cuts", "functions"):
            value = title_of_cuts(self.value) if self.key == "cuts" else ", ".join(self.value)
        else:
            value = title_of_value(self.value)
        return f"{self.part} {self.key} {value}".strip()


@dataclass(frozen=True, config=STRICT)
class Undo:
    """Take the latest step back."""

    type: Literal["undo"] = tag("undo")


@dataclass(frozen=True, config=STRICT)
class Redo:
    """Make the step again that was taken back last."""

    type: Literal["redo"] = tag("redo")


@dataclass(frozen=True, config=STRICT)
class Save:
    """Write the scene file."""

    name: str  # of the file, in the folder for saving
    replace: bool = False  # a file that is there already
    type: Literal["save"] = tag("save")


@dataclass(frozen=True, config=STRICT)
class Clicked:
    """Clicks on a view of a model alone: pixels to the right and down, and whether they are on the object."""

    camera: Orbit
    points: Annotated[tuple[Click, ...], Field(max_length=MOST_POINTS)]
    outline: Outline | None = field(default=None, kw_only=True)  # around the object: pixels, too


@dataclass(frozen=True, config=STRICT)
class Mask(Clicked):
    """Show what clicks select."""

    model: str
    id: Number = 0  # comes back with the mask
    type: Literal["mask"] = tag("mask")


@dataclass(frozen=True, config=STRICT)
class Segment(Clicked):
    """Make a segment of what clicks select."""

    part: str  # MODEL/SEGMENT, a new name
    type: Literal["segment"] = tag("segment")


@dataclass(frozen=True, config=STRICT)
class Look:
    """Give parts a new look, by a picture or by an instruction."""

    parts: Annotated[tuple[str, ...], Field(max_length=MOST_PARTS)] = ()  # none: all models
    style: str = ""  # name of a picture; "" with an instruction
    instruction: str = ""  # "" with a picture
    sphere: bool = False  # the picture is of a lit sphere, and goes onto surfaces by their normals
    preview: bool = False  # show on this page what it would be like, and change nothing
    camera: Orbit | None = None  # of a thumbnail; or the side from which words are previewed, all by default
    type: Literal["look"] = tag("look")


@dataclass(frozen=True, config=STRICT)
class Fit:
    """Fit a model of a function that the scene tries."""

    function: str
    type: Literal["fit"] = tag("fit")


@dataclass(frozen=True, config=STRICT)
class Keep:
    """Write a function into the file of its data set."""

    function: str
    type: Literal["keep"] = tag("keep")


@dataclass(frozen=True, config=STRICT)
class Export:
    """Write a file for the page to save."""

    kind: str  # of `exports_of`
    view: View  # that a turntable begins with
    stops: Annotated[tuple[Orbit, ...], Field(max_length=20)] = ()  # of a film; of fewer than 2, a turntable
    seconds: Annotated[float, Field(ge=0.1, le=600)] = 2.88  # of a film
    fps: Annotated[float, Field(ge=1, le=240)] = 25.0  # frames per second
    steps: Annotated[str, Field(max_length=9)] = "all"  # of a series, in a page; see `page_steps`
    type: Literal["export"] = tag("export")


@dataclass(frozen=True, config=STRICT)
class Rename:
    """Give a segment another name."""

    part: str  # MODEL/SEGMENT
    name: str  # of the segment
    type: Literal["rename"] = tag("rename")


@dataclass(frozen=True, config=STRICT)
class Remove:
    """Give the surfels of a segment back to its model."""

    part: str  # MODEL/SEGMENT
    type: Literal["remove"] = tag("remove")


@dataclass(frozen=True, config=STRICT)
class Cancel:
    """Stop the job that is at work, and show no preview any more."""

    preview: bool = False  # the preview alone; the job goes on
    type: Literal["cancel"] = tag("cancel")


Making = Mask | Segment | Look | Fit | Keep | Export
Message = View | Pick | Edit | Undo | Redo | Save | Making | Rename | Remove | Cancel
MESSAGES: TypeAdapter[Message] = TypeAdapter(Annotated[Message, Field(discriminator="type")])
VIEWS, LOOKS = TypeAdapter(View), TypeAdapter(Look)


def parse(text: str | bytes, adapter: TypeAdapter[Any] = MESSAGES) -> Any:
    """Return the message that a text holds."""
    try:
        return adapter.validate_json(text)
    except ValidationError as error:
        raise ArgumentError(sentence(error.errors(include_url=False)[0])) from error


def sentence(fault: Mapping[str, Any]) -> str:
    """Return what pydantic found wrong as key, what was expected and what there was."""
    tags = [each.__name__.lower() for each in get_args(Message)]
    keys = [str(key) for key in fault["loc"] if not str(key).startswith("literal[")]
    name = ".".join(keys[1:] if keys[:1] and keys[0] in tags else keys)
    match fault["type"]:
        case "json_invalid" | "dataclass_type" | "dict_type" | "model_attributes_type":
            return f"{name or 'message'}: expected keys with values in JSON, got {fault['input']!r:.100}"
        case "union_tag_invalid" | "union_tag_not_found":
            return f"type: expected one of {', '.join(tags)}, got {fault['input'].get('type')!r:.100}"
        case "missing":
            return f"{name}: expected a value, got none"
        case "unexpected_keyword_argument":
            return f"message: no such key {name!r:.100}"
        case "too_long" | "too_short":
            return f"{name}: {fault['msg']}"
    expected = fault["msg"].removeprefix("Input should be ")
    return f"{name}: expected {expected}, got {fault['input']!r:.100}"


def title_of_value(value: Any) -> str:
    """Return a value of an edit in few letters: #rrggbb, angles, a number."""
    if value is None:
        return "reset"
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {angle:.0f}°" for key, angle in value.items())
    if isinstance(value, list):
        return "#" + "".join(f"{round(255 * x):02x}" for x in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def title_of_cuts(cuts: Mapping[str, Any]) -> str:
    """Return cuts as a scene file has them in few words."""
    count = len(cuts.get("planes", ()))
    words = [f"{count} planes" if count > 1 else "1 plane"] if count else []
    if cuts.get("box"):
        words.append("box")
    if words and cuts.get("faces") == "unlit":
        words.append("unlit")
    return ", ".join(words) or "none"
