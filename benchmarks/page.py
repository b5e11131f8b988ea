"""How close the volume in a page is to the caster of the whole volume, and what its frames and opening take.

`python -m benchmarks.page OUTPUT.json NAME=volume.nrrd ...` takes prepared volumes. Functions are those
of `benchmarks.functions`. Chromium draws in software, and opens the page as a file, without a network.
"""

from __future__ import annotations

import json
import sys
from base64 import b64encode
from itertools import islice
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
import torch

from benchmarks import machine
from benchmarks.browser import SOFTWARE, browser_path
from benchmarks.functions import COUNT, COVER, NAME, SEED, functions, opened_scene, psnr
from benchmarks.results import note
from tests.viewer.drawing import drawn, open_renderer, view_of
from texgs.core.camera import Camera, orbit
from texgs.scene.frame import quantized
from texgs.scene.scene import Scene
from texgs.viewer.description import describe
from texgs.viewer.page_volume import PageVolume, page_volume
from texgs.viewer.standalone import pack, write_page
from texgs.volume.caster import Caster
from texgs.volume.nrrd_file import open_grid
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

FUNCTIONS, SIZE, SMALL = 50, 400, 200  # pixels of a picture, and those of one that moves
OPENINGS = 5  # of a page
NAME_OF_CARD = """() => {
  const gl = renderer._gl;
  return gl.getParameter(gl.getExtension("WEBGL_debug_renderer_info").UNMASKED_RENDERER_WEBGL);
}"""
TIME = """(words) => {
  const start = performance.now();
  renderer.pixels(...words); // reads them, so that all is drawn
  return performance.now() - start;
}"""


def main(output: str, *volumes: str) -> None:
    """Measure all volumes, print and write what was measured."""
    from playwright.sync_api import sync_playwright

    measured = {}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=SOFTWARE)
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
    file_of_page = folder / "page.html"
    write_page(file_of_page, scene, NAME, volume=volume)
    opened_in = [opened(browser, file_of_page) for _ in range(OPENINGS)]
    page, description = opened_renderer(browser, scene, volume)
    closeness = compared(page, description, scene, file)
    turning, changing = times(page, description, file)
    return {
        "samples": volume.codes.shape,
        "mb": len(volume.packed) / 1e6,
        "page_mb": file_of_page.stat().st_size / 1e6,
        "renderer": page.evaluate(NAME_OF_CARD),
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


def opened_renderer(browser: Any, scene: Scene, volume: PageVolume) -> tuple[Any, dict[str, Any]]:
    """Return a page that draws a scene as it is told, and the description of the scene."""
    composed, page = scene.open(), browser.new_page()
    description = describe(NAME, scene, composed) | {"volume": volume.describe(scene)}
    open_renderer(page, pack(composed), description, b64encode(volume.packed).decode())
    return page, description


def compared(page: Any, description: dict[str, Any], scene: Scene, file: Path) -> list[float]:
    """Return how close pictures at rest are to those of the caster, of functions that show something."""
    caster, closeness = Caster(open_grid(file), Appearance()), list[float]()
    for number, tf in enumerate(some_functions(file, 4 * FUNCTIONS)):
        camera = camera_of(number, SIZE)
        rgba = caster.cast(tf, camera, scene.light).rgba
        whole = quantized(rgba[..., :3] + 1 - rgba[..., 3:])
        if (whole != 255).any(axis=2).mean() >= COVER:
            picture = drawn(page, camera, tried(description, tf), "volume")
            closeness.append(psnr(picture, whole))
        if len(closeness) == FUNCTIONS:
            break
    return closeness


def times(page: Any, description: dict[str, Any], file: Path) -> tuple[list[float], list[float]]:
    """Return milliseconds of moving frames from new cameras, and of those with new functions."""
    turning, changing = list[float](), list[float]()
    for tf in some_functions(file, COUNT):
        scene, how = tried(description, tf), {"mode": "volume", "moving": True}
        for milliseconds, place in ((changing, 0), (turning, 1 + len(turning))):
            milliseconds.append(page.evaluate(TIME, [view_of(camera_of(place, SMALL)), scene, how]))
    return turning, changing


def some_functions(file: Path, count: int) -> list[TransferFunction]:
    """Return random functions of the values of a volume."""
    values = open_grid(file).values
    ends = float(np.nanmin(values)), float(np.nanmax(values))
    return list(islice(functions(np.random.default_rng(SEED), *ends), count))


def camera_of(number: int, size: int) -> Camera:
    """Return a view on the way around a volume."""
    return orbit(15 * number % 360 - 180, 20, 4, 30, size, size)


def tried(description: dict[str, Any], tf: TransferFunction) -> dict[str, Any]:
    """Return the description of a scene that tries a function."""
    return {**description, "functions": {NAME: tf.to_dict()}}


def spread(milliseconds: list[float]) -> dict[str, float]:
    """Return median and 90th percentile."""
    return {"median": median(milliseconds), "90": quantiles(milliseconds, n=10)[-1]}


if __name__ == "__main__":
    main(*sys.argv[1:])
