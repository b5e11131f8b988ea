"""A scene as one HTML file that needs no server and no network."""

import json
import re
import zlib
from base64 import b64encode
from dataclasses import asdict, dataclass
from hashlib import sha256
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from texgs import __version__
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.io import write_bytes
from texgs.fields.surfels.compact import TEXEL_STEP, compact_tensors
from texgs.fields.surfels.composition import Composition
from texgs.scene.cut_view import cut_view
from texgs.scene.exposure import require_shadows
from texgs.scene.frame import quantize
from texgs.scene.marks import with_marks
from texgs.scene.scene import Scene
from texgs.scene.twin import Twin, is_seen
from texgs.viewer.description import describe, presets
from texgs.viewer.origins import Origins
from texgs.viewer.page_light import PageLight, page_light
from texgs.viewer.page_steps import PageSteps, page_steps
from texgs.viewer.page_volume import PageVolume

LARGEST = 256 * 2**20  # bytes; browsers hold a text of twice as many
TEXEL_CODES = 2**15 - 1  # at most, of a texel on a graphics card
POSTER_SIDE = 512  # pixels
POSTER_QUALITY = 80  # of JPEG
IMPORT = re.compile(r'^import (\{[^}]*\}) from "\./([\w-]+\.js)";$', re.MULTILINE)
EXPORT = re.compile(r"^export ((?:async )?(?:function|class|const) (\w+))", re.MULTILINE)


@dataclass(frozen=True)
class ScenePage:
    """A page and facts of it."""

    text: str
    surfels: int
    poster: bytes  # a JPEG of the first view
    steps: PageSteps | None  # of the scene's series
    light: PageLight | None  # of its surfels, where it has no volume


def write_page(
    path: Path,
    scene: Scene,
    name: str,
    checked: str = "",
    volume: PageVolume | None = None,
    steps: str | int = "all",
) -> ScenePage:
    """Create or replace the page of a scene of surfels in one step; see `scene_page`."""
    with errors_at(path):
        page = scene_page(scene, name, checked, volume, steps)
    write_bytes(path, page.text.encode())
    return page


def scene_page(
    scene: Scene, name: str, checked: str = "", volume: PageVolume | None = None, steps: str | int = "all"
) -> ScenePage:
    """Return the page of a scene of surfels; the same scene gives the same text.

    The surfels are rounded as in compact model files. Hidden models are in the page: they can be shown there.

    Args:
        scene: to show.
        name: of the scene, the title.
        checked: what `texgs check` has found; it stands in the metadata, and below.
        volume: of the scene, which the page then shows with any transfer function, and behind cuts.
        steps: of its series, that the page moves through; see `page_steps`.
    """
    composed = scene.open()
    if not isinstance(composed, Composition):
        raise ArgumentError("expected a scene of surfels, got another kind; fit surfels for this")
    has_matter = len(composed) > 0 and any(is_seen(model.edit) for model in scene.models.values())
    is_hiding = max(scene.light.shadows, scene.light.occlusion) > 0 and has_matter
    if is_hiding:
        require_shadows(scene)
    twin = Twin(scene) if volume is not None or is_hiding else None  # refuses one that is not of the models
    light = page_light(scene, composed, twin) if twin is not None and volume is None else None
    surfels, moved = pack(composed, light), page_steps(scene, steps)
    if (size := len(surfels) + (moved.size if moved else 0)) > LARGEST:
        raise ArgumentError(
            f"expected surfels of at most {LARGEST >> 20} MiB, got {size >> 20} MiB for "
            f"{len(composed)} of them; export fewer models{' or steps' if moved else ''}"
        )
    description = describe(name, scene, composed)
    if moved is not None:
        description["held"] = list(moved.packed)
    description["can_shadow"] = volume is not None or light is not None
    if volume is not None:
        description |= {"volume": volume.describe(scene), "presets": presets()}
        description |= {"slices": volume.slices(scene), "transfer": Origins(scene).transfer}
    view = description["views"][0] | {"fov_y": description["fov_y"]}
    picture = poster(scene, composed, view, twin, has_faces=volume is not None)
    html = page_of(description, surfels, picture, checked, volume, moved, light)
    return ScenePage(html, len(composed), picture, moved, light)


def page_of(
    description: dict[str, Any],
    surfels: str,
    picture: bytes,
    checked: str,
    volume: PageVolume | None,
    steps: PageSteps | None,
    light: PageLight | None,
) -> str:
    """Return the page of a description, see `describe`, packed surfels, and a JPEG that is shown first.

    Nothing but its own script and style may run in it, and it may load nothing: names of a scene are text.
    """
    from jinja2 import Environment
    from markupsafe import Markup

    script = f"\n{joined_modules('standalone.js')}"
    style = f"\n{web_file('style.css')}{web_file('standalone.css')}"
    return (
        Environment(autoescape=True)
        .from_string(web_file("standalone.html.j2"))
        .render(
            name=description["name"],
            version=__version__,
            checked=checked,
            policy=f"default-src 'none'; script-src '{digest(script)}'; style-src '{digest(style)}'; "
            "img-src data:; base-uri 'none'; form-action 'none'",
            script=Markup(script),
            style=Markup(style),
            scene=Markup(json.dumps(description).replace("<", r"\u003c")),
            surfels=Markup(surfels),
            volume=Markup(b64encode(volume.packed).decode()) if volume else "",
            volume_words=f"The page has the volume in {volume}." if volume else "",
            has_editor=bool(description.get("transfer")),
            steps=steps,
            light=light,
            time=description["time"],
            poster=b64encode(picture).decode(),
        )
    )


def poster(
    scene: Scene, composed: Composition, view: dict[str, Any], twin: Twin | None, *, has_faces: bool
) -> bytes:
    """Return a view of a scene, see `describe`, as JPEG; a twin hides light, and cuts may have its faces."""
    place = (view["azimuth"], view["polar"], view["distance"], view["fov_y"], POSTER_SIDE, POSTER_SIDE)
    camera = orbit(*place, target=view["target"])
    # Cuts are hollow where more than colours is asked for.
    more = ("depth",) if twin is not None and not has_faces else ()
    background = torch.tensor(scene.background)
    seen = cut_view(composed, camera, scene, twin, background=background, outputs=more)
    pixels = with_marks(quantize(seen.color), camera, scene)
    file = BytesIO()
    Image.fromarray(pixels).save(file, "JPEG", quality=POSTER_QUALITY, optimize=True)
    return file.getvalue()


def digest(text: str) -> str:
    """Return the hash of a script or a style for a content security policy."""
    return f"sha256-{b64encode(sha256(text.encode()).digest()).decode()}"


def pack(composition: Composition, light: PageLight | None = None) -> str:
    """Return the tensors of all models as text, named NUMBER.PARAMETER.

    Among them are `labels` [N] of segments, and `exposure` [10, N] of light, see `PageLight.packed`. The same
    scene gives the same text. Browsers unpack zlib by themselves, but not xz.
    """
    from safetensors.numpy import save

    tensors: dict[str, np.ndarray] = {}
    first = 0
    for number, part in enumerate(composition.parts):
        model = part.model.to("cpu")
        if "texels" in model.parameters:
            require_range(model.parameters["texels"])
        own = compact_tensors(model)
        if part.labels is not None:
            own["labels"] = part.labels.cpu().numpy().astype(np.uint8 if part.segments < 256 else np.int32)
        if light is not None:
            own["exposure"] = light.packed(first, len(model))
        first += len(model)
        tensors |= {f"{number}.{name}": values for name, values in own.items()}
    optics = [asdict(part.model.shading) for part in composition.parts]
    facts = {"models": optics, "low_pass": composition.options.low_pass, "step": TEXEL_STEP}
    if light is not None:
        facts["exposure"] = light.scales
    # One entry: safetensors writes several in any order.
    return b64encode(zlib.compress(save(tensors, {"optics": json.dumps(facts)}), 9)).decode()


def require_range(texels: Tensor) -> None:
    """Require texels [T, 3] that 16 bits hold."""
    largest = float(texels.abs().max()) if len(texels) else 0.0
    if largest > TEXEL_CODES * TEXEL_STEP:
        raise ArgumentError(
            f"texels: expected at most {TEXEL_CODES * TEXEL_STEP:g}, got {largest:g}; fit the texture again"
        )


def web_file(name: str) -> str:
    """Return the text of a file of texgs/viewer/web."""
    return files("texgs.viewer").joinpath("web", name).read_text(encoding="utf-8")


def joined_modules(entry: str) -> str:
    """Return a module and all that it imports, each once and behind what it imports.

    Each becomes a function with its own names, which returns what the module exports into `modules`. That
    does for modules that import by name, from the same folder, and whose exports are declarations.
    """
    texts: dict[str, str] = {}

    def add(name: str) -> None:
        text = web_file(name)
        for _, imported in IMPORT.findall(text):
            if imported not in texts:
                add(imported)
        exports = ", ".join(exported for _, exported in EXPORT.findall(text))
        body = EXPORT.sub(r"\1", IMPORT.sub(r'const \1 = modules["\2"];', text)).strip()
        texts[name] = f'modules["{name}"] = (() => {{\n{body}\nreturn {{ {exports} }};\n}})();'

    add(entry)
    return "\n\n".join(["const modules = {};", *texts.values()]) + "\n"
