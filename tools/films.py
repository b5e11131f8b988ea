"""Make the films of docs/viewer.md: a dragged function, a model made of one, and a page without a network.

`python -m tools.films SCENE` takes a scene.yaml of `engine` from the workflow, and enters the films in
benchmarks/results/index.csv. A film is as fast as what it shows was on this machine, pictures of it included;
that of the model is faster by `FASTER`.

`python -m tools.films SERIES EDITED` makes that of a series in docs/scenes.md: two scenes of `rings` side by
side, as fitted and with a style, through all steps while the camera turns.

`python -m tools.films light SCENE SCENE` makes that of light there: scenes side by side, with shadows and
occlusion, under a light that rises.
"""

import subprocess
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any

import numpy as np
from PIL import Image

from benchmarks.browser import SOFTWARE, browser_path, viewer
from benchmarks.command import call
from benchmarks.results import add
from texgs.scene.film import Film as SceneFilm
from texgs.scene.scene import Scene
from texgs.scene.scene_file import read_scene
from texgs.scene.session import Session
from tools.pictures import DOCS, PROGRAM, SHADOWED

WINDOW, SIZE = {"width": 1120, "height": 700}, (720, 450)  # of the browser, and of a film, pixels
FASTER = 8
LAST = 2000  # milliseconds that the last frame stays
WAIT = 240_000  # milliseconds at most, on a busy machine
QUALITY = 55
EACH, SHORT = 3, 80  # frames of a step of a series, and how long one is shown, milliseconds
VIEW = "#azimuth=-60&polar=20"


class Film:
    """Pictures of a page and when they were taken."""

    def __init__(self, page: Any, faster: float = 1) -> None:
        self._page, self._faster = page, faster
        self._frames, self._times = list[Image.Image](), list[float]()

    def shoot(self) -> None:
        """Take a picture."""
        picture = Image.open(BytesIO(self._page.screenshot(type="jpeg", quality=92)))
        self._frames.append(picture.resize(SIZE, Image.Resampling.LANCZOS))
        self._times.append(monotonic())

    def write(self, path: Path) -> None:
        """Write all pictures as an animation."""
        spans = [b - a for a, b in zip(self._times, self._times[1:], strict=False)]
        durations = [round(1000 * span / self._faster) for span in spans]
        animate(path, self._frames, [*durations, LAST])


def animate(path: Path, frames: list[Image.Image], durations: list[int]) -> None:
    """Write pictures that are shown for some milliseconds each."""
    first, *others = frames
    options = {"duration": durations, "loop": 0, "quality": QUALITY, "method": 6}
    first.save(path, save_all=True, append_images=others, **options)
    print(f"{path}: {path.stat().st_size / 1024:.0f} KiB, {sum(durations) / 1000:.0f} s")


def through_time(path: Path, *files: str) -> None:
    """Write a film of scenes of one series side by side: all steps, around which the camera turns."""
    scenes = [read_scene(file) for file in files]
    count = EACH * len(scenes[0].timeline.steps)
    side_by_side(path, scenes, SceneFilm(what="orbit-time", frames=count, azimuth=-60.0))


def under_light(path: Path, *files: str) -> None:
    """Write a film of scenes side by side, with shadows, under a light that rises."""
    scenes = [replace(scene, light=SHADOWED) for scene in map(read_scene, files)]
    side_by_side(path, scenes, SceneFilm(what="light", azimuth=120.0))


def side_by_side(path: Path, scenes: list[Scene], film: SceneFilm) -> None:
    """Write what a film shows of scenes."""
    columns = []
    for scene in scenes:
        session, lens = Session(scene), scene.framed().lens().square(SIZE[1] * 4 // 5)
        shots = film.shots(scene, session.composition, lens)
        columns.append([session.frame(camera, scene=shown) for camera, shown in shots])
    frames = [Image.fromarray(np.concatenate(pair, axis=1)) for pair in zip(*columns, strict=True)]
    animate(path, frames, [SHORT] * len(frames))


def drag(page: Any, film: Film, what: Any, *ways: tuple[float, float]) -> None:
    """Drag something by ways on the screen, with a picture after each step of some pixels."""
    what.scroll_into_view_if_needed()
    box = what.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for dx, dy in ways:
        steps = max(1, round(max(abs(dx), abs(dy)) / 4))
        for _ in range(steps):
            x, y = x + dx / steps, y + dy / steps
            page.mouse.move(x, y)
            film.shoot()
    page.mouse.up()
    page.wait_for_timeout(700)
    film.shoot()


def dragged(page: Any) -> Film:
    """Show the volume with a function of which a point, and then the whole, is dragged."""
    film = Film(page)
    page.select_option("#mode", "volume")
    page.wait_for_timeout(1500)
    film.shoot()
    page.locator("#transfer .names button").nth(1).click()
    drag(page, film, page.locator("#transfer circle").nth(2), (-60, 0), (30, 20))
    drag(page, film, page.locator("#transfer path.edited"), (-60, 0), (40, 0))
    return film


def made(page: Any) -> Film:
    """Make a model of a new function."""
    film = Film(page, FASTER)
    page.get_by_role("button", name="New", exact=True).click()
    page.get_by_label("Opacity of the point").fill("0.3")
    page.get_by_label("Colours of a preset").select_option("Viridis")
    page.wait_for_timeout(1000)
    film.shoot()
    page.get_by_role("button", name="Make model").click()
    page.locator("#job").wait_for(timeout=WAIT)  # the server starts it after the click
    end = monotonic() + WAIT / 1000
    while monotonic() < end and page.locator("#job").is_visible():
        page.wait_for_timeout(400)
        film.shoot()
    page.wait_for_timeout(1500)
    film.shoot()
    return film


def alone(page: Any) -> Film:
    """Turn a page that has its volume and no network, drag a function, and cut it."""
    film = Film(page)
    film.shoot()
    drag(page, film, page.locator("#picture"), (90, 10))
    page.select_option("#mode", "volume")
    page.locator("#transfer .names button").nth(1).click()
    drag(page, film, page.locator("#transfer path.edited"), (-50, 0), (50, 0))
    page.select_option("#mode", "shaded")
    page.get_by_role("button", name="Add a plane").click()
    page.wait_for_timeout(1500)
    film.shoot()
    drag(page, film, page.locator("#handles .reach").first, (40, 0), (-60, 0))
    return film


def main(source: str, *edited: str) -> None:
    """Make all films of a scene, or that of a series or of light."""
    if edited and source == "light":
        path = DOCS / "light.webp"
        under_light(path, *edited)
        add(path, "python -m tools.films light SCENE SCENE", "compose texgs.scene.film texgs.scene.exposure")
        return
    if edited:
        path = DOCS / "series.webp"
        through_time(path, source, *edited)
        add(path, "python -m tools.films SERIES EDITED", "steps image texgs.scene.film")
        return
    from playwright.sync_api import expect, sync_playwright

    with sync_playwright() as playwright, TemporaryDirectory() as folder:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=SOFTWARE)
        context = browser.new_context(viewport=WINDOW)
        for name, show in (("drag", dragged), ("model", made)):
            with viewer(source) as address:
                page = context.new_page()
                page.goto(address + VIEW)
                expect(page.locator("#pace")).to_contain_text("ms", timeout=WAIT)
                write(name, show(page))
                page.close()
        file = Path(folder, "engine.html")
        subprocess.run([PROGRAM, "export", source, "--to", file, "--volume"], check=True)
        context.set_offline(True)
        page = context.new_page()
        page.goto(file.as_uri() + VIEW)
        page.wait_for_selector("#picture[aria-busy=false]", timeout=WAIT)
        write("page", alone(page))


def write(name: str, film: Film) -> None:
    """Write a film, and enter it."""
    path = DOCS / f"{name}.webp"
    film.write(path)
    add(path, "python -m tools.films SCENE", "compose texgs.viewer.server texgs.viewer.standalone")


if __name__ == "__main__":
    call(main)
