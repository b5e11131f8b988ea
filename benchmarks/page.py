"""How close the volume in a page is to the caster of the whole volume, and what its frames and opening take.

`python -m benchmarks.page OUTPUT.json NAME=volume.nrrd ...` takes prepared volumes. Functions are those
of `benchmarks.functions`. Chromium draws in software, and opens the page as a file, without a network.
"""

from __future__ import annotations

import json
import shutil
import sys
from base64 import b64decode, b64encode
from itertools import islice
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
import torch

from benchmarks import machine
from benchmarks.functions import COUNT, COVER, NAME, SEED, functions, opened_scene, psnr
from benchmarks.results import note
from texgs.core.camera import Camera, orbit
from texgs.scene.frame import quantized
from texgs.scene.scene import Scene
from texgs.viewer.description import describe
from texgs.viewer.page_volume import PageVolume, page_volume
from texgs.viewer.standalone import joined_modules, pack, write_page
from texgs.volume.caster import Caster
from texgs.volume.nrrd_file import open_grid
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

FUNCTIONS, SIZE, SMALL = 50, 400, 200  # pixels of a picture, and those of one that moves
OPENINGS = 5  # of a page
SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SCRIPT = """
const { WebglRenderer } = modules["webgl.js"];
globalThis.start = async (...words) => {
  const canvas = document.body.appendChild(document.createElement("canvas"));
  globalThis.renderer = new WebglRenderer(canvas, (text) => console.log(text));
  await renderer.open(...words);
  const gl = canvas.getContext("webgl2");
  return gl.getParameter(gl.getExtension("WEBGL_debug_renderer_info").UNMASKED_RENDERER_WEBGL);
};
globalThis.shoot = (view, scene, shown) => {
  const start = performance.now(), pixels = renderer.pixels(view, scene, shown);
  const took = performance.now() - start;
  let text = "";
  for (let i = 0; i < pixels.length; i += 4096) text += String.fromCharCode(...pixels.subarray(i, i + 4096));
  return [took, btoa(text)];
};
"""


def main(output: str, *volumes: str) -> None:
    """Measure all volumes, print and write what was measured."""
    from playwright.sync_api import sync_playwright

    measured = {}
    path = next(filter(None, map(shutil.which, BROWSERS)))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=SOFTWARE)
        for name, _, file in (words.partition("=") for words in volumes):
            with machine.Load() as load, TemporaryDirectory() as folder:
                measured[name] = of_volume(browser, Path(file), Path(folder))
            measured[name]["load"] = str(load)
            print(name, measured[name])
        version = browser.version
    facts = {
        "machine": machine.describe(torch.device("cpu")),
        "chromium": version,
        "size": SIZE,
        "small": SMALL,
    }
    Path(output).write_text(json.dumps({**facts, "volumes": measured}, indent=1) + "\n", encoding="utf-8")
    note(output, "benchmarks.page texgs.viewer.page_volume texgs.viewer.standalone")


def of_volume(browser: Any, file: Path, folder: Path) -> dict[str, object]:
    """Return closeness in dB, milliseconds of frames, and seconds of the page of a volume."""
    scene = opened_scene(file, folder).scene
    start = perf_counter()
    volume = page_volume(scene)
    packed_in = perf_counter() - start
    written = write_page(folder / "page.html", scene, NAME, volume=volume)
    opened_in = [opened(browser, written.path) for _ in range(OPENINGS)]
    page, renderer, description = opened_renderer(browser, scene, volume)
    closeness = compared(page, description, scene, file)
    turning, changing = times(page, description, file)
    return {
        "samples": volume.codes.shape,
        "mb": len(volume.packed) / 1e6,
        "page_mb": written.path.stat().st_size / 1e6,
        "renderer": renderer,
        "seconds": {"packed": packed_in, "opened": opened_in},
        "functions": len(closeness),
        "db": {
            "mean": float(np.mean(closeness)),
            "tenth": float(np.quantile(closeness, 0.1)),
            "all": closeness,
        },
        "moving_ms": {"turning": spread(turning), "new_function": spread(changing)},
    }


def opened(browser: Any, file: Path) -> float:
    """Return the seconds until a page shows its scene."""
    page = browser.new_page()
    start = perf_counter()
    page.goto(file.as_uri())
    page.wait_for_selector("#picture:not([hidden])")
    seconds = perf_counter() - start
    page.close()
    return seconds


def opened_renderer(browser: Any, scene: Scene, volume: PageVolume) -> tuple[Any, str, dict[str, Any]]:
    """Return a page that draws a scene where it is told to, what draws it, and the description."""
    composed = scene.open()
    description = describe(NAME, scene, composed) | {"volume": volume.describe(scene)}
    page = browser.new_page()
    page.set_content(
        f"<!doctype html><body><script type=module>{joined_modules('webgl.js')}{SCRIPT}</script>"
    )
    page.wait_for_function("globalThis.start !== undefined")
    words = [pack(Path(NAME), composed), description, b64encode(volume.packed).decode()]
    return page, page.evaluate("(words) => start(...words)", words), description


def compared(page: Any, description: dict[str, Any], scene: Scene, file: Path) -> list[float]:
    """Return how close pictures at rest are to those of the caster, of functions that show something."""
    caster, closeness = Caster(open_grid(file), Appearance()), list[float]()
    for number, tf in enumerate(some_functions(file, 4 * FUNCTIONS)):
        camera = camera_of(number, SIZE)
        rgba = caster.cast(tf, camera, scene.light).rgba
        whole = quantized(rgba[..., :3] + 1 - rgba[..., 3:])
        if (whole != 255).any(axis=2).mean() >= COVER:
            picture = shot(page, description, tf, camera)[1]
            closeness.append(psnr(picture, whole))
        if len(closeness) == FUNCTIONS:
            break
    return closeness


def times(page: Any, description: dict[str, Any], file: Path) -> tuple[list[float], list[float]]:
    """Return milliseconds of moving frames from new cameras, and of those with new functions."""
    turning, changing = list[float](), list[float]()
    for tf in some_functions(file, COUNT):
        changing.append(shot(page, description, tf, camera_of(0, SMALL), moving=True)[0])
        turning.append(shot(page, description, tf, camera_of(len(turning), SMALL), moving=True)[0])
    return turning, changing


def some_functions(file: Path, count: int) -> list[TransferFunction]:
    """Return random functions of the values of a volume."""
    values = open_grid(file).values
    ends = float(np.nanmin(values)), float(np.nanmax(values))
    return list(islice(functions(np.random.default_rng(SEED), *ends), count))


def camera_of(number: int, size: int) -> Camera:
    """Return a view on the way around a volume."""
    return orbit(15 * number % 360 - 180, 20, 4, 30, size, size)


def shot(
    page: Any, description: dict[str, Any], tf: TransferFunction, camera: Camera, **shown: object
) -> tuple[float, np.ndarray]:
    """Return milliseconds and the picture [H, W, 3], uint8, of the volume with a function."""
    size = {"width": camera.width, "height": camera.height}
    view = {"viewmat": camera.viewmat[:3].tolist(), "fov_y": 30, **size}
    scene = {**description, "functions": {NAME: tf.to_dict()}}
    words = [view, scene, {"mode": "volume", **shown}]
    took, text = page.evaluate("(words) => shoot(...words)", words)
    picture = np.frombuffer(b64decode(text), np.uint8).reshape(camera.height, camera.width, 4)
    return took, picture[..., :3]


def spread(milliseconds: list[float]) -> dict[str, float]:
    """Return median and 90th percentile."""
    return {"median": median(milliseconds), "90": quantiles(milliseconds, n=10)[-1]}


if __name__ == "__main__":
    main(*sys.argv[1:])
