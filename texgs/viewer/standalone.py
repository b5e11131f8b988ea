"""A scene as one HTML file that needs no server and no network."""

from __future__ import annotations

import json
from base64 import b64encode
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image

from texgs import __version__
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.core.io import write_bytes
from texgs.fields.surfels.composition import Composition
from texgs.scene.frame import frame
from texgs.scene.scene import Scene
from texgs.viewer.description import describe
from texgs.viewer.modules import joined_modules, web_file
from texgs.viewer.packing import pack

LARGEST = 256 * 2**20  # bytes; browsers hold a text of twice as many
POSTER = 512  # pixels of either side
QUALITY = 80  # of the poster, a JPEG


@dataclass(frozen=True)
class WrittenPage:
    """A page, and what is known of it."""

    path: Path
    surfels: int
    poster: bytes  # a JPEG of the first view


def write_page(path: Path, scene: Scene, name: str) -> WrittenPage:
    """Create or replace the page of a scene in one step; the same scene gives the same bytes.

    The surfels are rounded as in compact model files. Hidden models are in the page: they can be shown there.

    Args:
        path: target, .html.
        scene: of surfels.
        name: of the scene, its title.

    Raises:
        ArgumentError, ShapeError: if a model is missing, damaged or not one of surfels with shading, the page
            would be too large for a browser, or the file cannot be written.
    """
    composed = scene.open()
    if not isinstance(composed, Composition):
        raise ArgumentError(
            f"{path}: expected a scene of surfels, got one of another kind; fit surfels for this"
        )
    surfels = pack(path, composed)
    if len(surfels) > LARGEST:
        raise ArgumentError(
            f"{path}: expected surfels of at most {LARGEST >> 20} MiB, got {len(surfels) >> 20} MiB for "
            f"{len(composed)} of them; export fewer models"
        )
    description = describe(name, scene, composed)
    picture = poster(scene, composed, description["views"][0], description["fov_y"])
    write_bytes(path, page_of(description, surfels, picture).encode())
    return WrittenPage(path, len(composed), picture)


def page_of(description: dict[str, Any], surfels: str, picture: bytes) -> str:
    """The page as text.

    Nothing but its own script and style may run in it, and it may load nothing: names of a scene are text.

    Args:
        description: of the scene, see `describe`.
        surfels: packed, see `pack`.
        picture: a JPEG that is shown until there is another one.
    """
    from jinja2 import Environment
    from markupsafe import Markup

    script = f"\n{joined_modules('standalone.js')}"
    style = f"\n{web_file('style.css')}{web_file('standalone.css')}"
    template = files("texgs.viewer").joinpath("web", "standalone.html.j2").read_text(encoding="utf-8")
    return (
        Environment(autoescape=True)
        .from_string(template)
        .render(
            name=description["name"],
            version=__version__,
            policy=f"default-src 'none'; script-src '{digest(script)}'; style-src '{digest(style)}'; "
            "img-src data:; base-uri 'none'; form-action 'none'",
            script=Markup(script),
            style=Markup(style),
            scene=Markup(json.dumps(description).replace("<", r"\u003c")),
            surfels=Markup(surfels),
            poster=b64encode(picture).decode(),
        )
    )


def poster(scene: Scene, composed: Composition, view: dict[str, Any], fov_y: float) -> bytes:
    """A view of a scene, see `describe`, as JPEG."""
    place = (view["azimuth"], view["polar"], view["distance"], fov_y, POSTER, POSTER)
    camera = orbit(*place, target=view["target"])
    shown = frame(composed, camera, scene.light, scene.edits, background=scene.background)
    file = BytesIO()
    Image.fromarray(shown).save(file, "JPEG", quality=QUALITY, optimize=True)
    return file.getvalue()


def digest(text: str) -> str:
    """What a content security policy knows a script or a style by."""
    return f"sha256-{b64encode(sha256(text.encode()).digest()).decode()}"
