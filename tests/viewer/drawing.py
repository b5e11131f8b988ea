"""Pictures that webgl.js draws in a browser, and those of the rasterizer for the same numbers."""

import json
import zlib
from base64 import b64decode, b64encode
from pathlib import Path

import numpy as np
import torch
from safetensors.numpy import load

from texgs.core.cuts import NO_CUTS
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel
from texgs.scene.frame import frame
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.twin import Twin
from texgs.viewer.description import describe
from texgs.viewer.page_steps import page_steps
from texgs.viewer.page_volume import page_volume
from texgs.viewer.standalone import joined_modules, pack

START = """
const { WebglRenderer } = modules["webgl.js"];
Object.assign(globalThis, modules["sort.js"], modules["tensors.js"]);
globalThis.start = async (packed, scene, volume, steps) => {
  const canvas = document.body.appendChild(document.createElement("canvas"));
  globalThis.renderer = new WebglRenderer(canvas, (text) => console.log(text));
  await renderer.open(packed, scene, volume, steps);
};
globalThis.shoot = async (camera, scene, shown) => {
  const pixels = await renderer.at(scene.time, () => renderer.pixels(camera, scene, shown));
  let text = "";
  for (let i = 0; i < pixels.length; i += 4096) text += String.fromCharCode(...pixels.subarray(i, i + 4096));
  return btoa(text);
};
"""


def open_renderer(page, packed, description, volume="", steps=()):
    """Give a blank page the renderer with a scene, its volume and its steps in time."""
    page.set_content(f"<!doctype html><body><script type=module>{joined_modules('webgl.js')}{START}</script>")
    page.wait_for_function("globalThis.start !== undefined")
    page.evaluate("(words) => start(...words)", [packed, description, volume, list(steps)])


def view_of(camera):
    """A camera as the renderer takes it."""
    fov_y = 2 * np.degrees(np.arctan(0.5 * camera.height / float(camera.K[1, 1])))
    size = {"width": camera.width, "height": camera.height}
    return {"viewmat": camera.viewmat[:3].tolist(), "fov_y": fov_y, **size}


def drawn(page, camera, description, mode="shaded", **shown):
    """What the renderer draws [H, W, 3], uint8."""
    words = [view_of(camera), description, {"mode": mode, **shown}]
    text = page.evaluate("(words) => shoot(...words)", words)
    return np.frombuffer(b64decode(text), np.uint8).reshape(camera.height, camera.width, 4)[..., :3]


def unpacked(packed):
    """The models in a packed text, and the labels of their surfels, read without the code that wrote them."""
    raw = zlib.decompress(b64decode(packed))
    length = int.from_bytes(raw[:8], "little")
    facts = json.loads(json.loads(raw[8 : 8 + length])["__metadata__"]["optics"])
    tensors = load(raw)
    models, labels = [], []
    for number, optics in enumerate(facts["models"]):
        own = {name.partition(".")[2]: x for name, x in tensors.items() if name.startswith(f"{number}.")}
        labels.append(own.pop("labels", None))
        if "codes" in own:
            whole = sum(plane.astype(np.int64) << 8 * k for k, plane in enumerate(own.pop("codes")))
            green, red, blue = np.where(whole % 2, -(whole + 1) // 2, whole // 2)
            own["texels"] = np.stack([red + green, green, blue + green], 1) * np.float32(facts["step"])
            counts = own["sizes"].astype(np.int64).prod(1)
            own["offsets"] = counts.cumsum() - counts
        exact = ("sizes", "offsets")
        p = {name: torch.tensor(x if name in exact else x.astype(np.float32)) for name, x in own.items()}
        models.append(Surfels(p, ShadingModel(**optics)))
    return models, labels


def composed_of(packed):
    """The scene in a packed text."""
    models, labels = unpacked(packed)
    masks = [
        [] if own is None else [torch.tensor(own == k) for k in range(1, int(own.max()) + 1)]
        for own in labels
    ]
    return Composition(models, masks)


def rendered(packed, camera, light, edits, background, mode="shaded", cuts=NO_CUTS):
    """What the rasterizer makes of the numbers in a packed text [H, W, 3], uint8."""
    models = {str(number): SceneModel(Path(), edit) for number, edit in enumerate(edits)}
    return frame(composed_of(packed), camera, Scene(models, light, background, cuts), mode)


class Drawing:
    """A browser that draws a scene, and what texgs renders of it; nothing may go wrong in it.

    Args:
        chromium: that draws.
        scene: as it is opened; changes of it are drawn, too.
        has_volume: whether the page has the scene's volume.
        is_exact: whether texgs renders the numbers of the page, which are rounded.
        script: that runs before all others.
    """

    def __init__(self, chromium, scene, *, has_volume=False, is_exact=False, script="() => {}"):
        composed, steps = scene.open(), page_steps(scene)
        self.scene, self._packed, self._is_exact = scene, pack(composed), is_exact
        self._held = {"held": list(steps.packed)} if steps else {}
        self._volume = page_volume(scene, 100) if has_volume else None
        self.page, self.errors = chromium.new_page(), []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda said: self.errors.append(said.text) if said.type == "error" else None)
        self.page.evaluate(script)
        volume = b64encode(self._volume.packed).decode() if self._volume else ""
        held = steps.packed.values() if steps else ()
        open_renderer(self.page, self._packed, self.describe(scene), volume, held)

    def describe(self, scene):
        """The description of a scene of the same models."""
        described = describe("test", scene, scene.open()) | self._held
        if self._volume:
            described |= {"volume": self._volume.describe(scene), "slices": self._volume.slices(scene)}
        return described

    def draw(self, scene, camera, mode="shaded", **shown):
        """What the page draws [H, W, 3], integers."""
        return drawn(self.page, camera, self.describe(scene), mode, **shown).astype(int)

    def render(self, scene, camera, mode="shaded"):
        """What texgs renders [H, W, 3], integers."""
        composed = composed_of(self._packed) if self._is_exact else scene.open()
        twin = Twin(scene) if self._volume else None
        return frame(composed, camera, scene, mode, twin).astype(int)


def closeness(one, other):
    """PSNR of two pictures, dB."""
    return -10 * np.log10(max(np.mean((one / 255.0 - other / 255.0) ** 2), 1e-9))
