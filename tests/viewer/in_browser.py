"""The viewer in a browser: its server in a process of its own, a page at a known camera, what it shows."""

import io
import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager

import numpy as np
import pytest
from PIL import Image

from texgs.cli.main import main
from texgs.core.camera import orbit

expect = pytest.importorskip("playwright.sync_api", reason="needs Playwright").expect

PLACE = {"azimuth": 40, "polar": 10, "distance": 3.5, "fov_y": 35}
LINK = "#" + "&".join(f"{key}={value}" for key, value in PLACE.items()) + "&target=0,0,0"
WAIT = 60_000  # milliseconds, on a busy machine
HIDE = "marks => { marks.style.visibility = 'hidden'; }"  # what lies over the picture
JPEG = 1.5  # levels of 255: what quality 95 costs on average


@contextmanager
def served(scene_file, port=0, styles=None, **environment):
    """A server in a process of its own, and its address."""
    words = [sys.executable, "-m", "texgs.cli.main", "view", str(scene_file)]
    words += ["--no-browser", "--port", str(port)]
    words += ["--styles", str(styles)] if styles else []
    env = {**os.environ, "TEXGS_CACHE": str(scene_file.parent / "cache"), **environment}
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=env)
    try:
        yield process, process.stdout.readline().strip()
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)


@contextmanager
def opened(chromium, address, ratio=1):
    """A page at a known camera, whose first whole frame is there. It must log no error."""
    page = chromium.new_page(viewport={"width": 800, "height": 500}, device_scale_factor=ratio)
    page.set_default_timeout(WAIT)
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("dialog", lambda dialog: dialog.accept())
    page.goto(address + LINK)
    expect(page.locator("#pace")).to_contain_text("ms", timeout=WAIT)
    page.wait_for_timeout(500)
    yield page
    page.close()
    assert errors == []


@contextmanager
def opened_file(chromium, file, link=LINK, ratio=1, size=(800, 500)):
    """A page that is opened as a file. It must log no error, and ask for nothing."""
    page = chromium.new_page(
        viewport=dict(zip(("width", "height"), size, strict=True)), device_scale_factor=ratio
    )
    page.set_default_timeout(WAIT)
    wrong, asked = [], []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    page.on("request", lambda request: asked.append(request.url))
    page.goto(file.as_uri() + link)
    page.wait_for_selector("#picture:not([hidden])", timeout=WAIT)
    settle(page)
    yield page
    page.close()
    assert wrong == []
    assert [url for url in asked if not url.startswith(("data:", "blob:", file.as_uri()))] == []


@contextmanager
def standalone(chromium, scene_file, *words, ratio=1, link=LINK):
    """The page of an export with some words, at the known camera."""
    file = scene_file.with_suffix(".html")
    assert main(["export", str(scene_file), "--to", str(file), *words]) == 0
    with opened_file(chromium, file, link, ratio) as page:
        yield page


def settle(page):
    """Wait for the frame in full that follows a movement."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    page.wait_for_selector("#picture[aria-busy=false]", timeout=WAIT)


def rendered(scene_file, page, *words):
    """What `texgs render` writes for the page's camera: bytes of a PNG."""
    box, output = page.locator("#picture").bounding_box(), scene_file.parent / "render.png"
    size = ["--width", str(round(box["width"])), "--height", str(round(box["height"]))]
    camera = ["--azimuth", str(PLACE["azimuth"]), "--polar", str(PLACE["polar"])]
    lens = ["--radius", str(PLACE["distance"]), "--fov", str(PLACE["fov_y"]), "--target", "0", "0", "0"]
    assert main(["render", str(scene_file), "--output", str(output), *size, *camera, *lens, *words]) == 0
    return output.read_bytes()


def still(page):
    """What the button writes: bytes of a PNG."""
    with page.expect_download() as download:
        page.get_by_role("button", name="Picture", exact=True).click()
    with open(download.value.path(), "rb") as file:  # noqa: PTH123
        return file.read()


def pixels(png):
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)


def shown(page):
    """Pixels of the picture on the screen, without what lies over its last rows."""
    page.wait_for_timeout(500)
    page.wait_for_selector("#picture:not([aria-busy=true])", timeout=WAIT)
    page.locator("#marks").evaluate(HIDE)
    return pixels(page.locator("#picture").screenshot())[:-50]


def camera_of(page):
    """The camera that the command of the view has, once it stays."""
    options = page.locator("#options")
    commands = ["", options.inner_text()]
    while commands[-1] != commands[-2]:
        page.wait_for_timeout(800)
        commands.append(options.inner_text())
    words = re.sub(r" -(\d)", r" =\1", commands[-1]).split("--")[1:]
    numbers = {name: [float(x.replace("=", "-")) for x in rest] for name, *rest in map(str.split, words)}
    angles = [numbers[name][0] for name in ("azimuth", "polar", "radius", "fov")]
    return orbit(*angles, *(int(numbers[name][0]) for name in ("width", "height")), numbers["target"])


def save_as(page, name):
    page.get_by_role("button", name="Save").click()
    page.get_by_label("File name").fill(name)
    page.keyboard.press("Enter")
    expect(page.get_by_text(re.compile(f"^Saved as .*/{name}"))).to_be_visible(timeout=WAIT)


def drag(page, what, start, end):
    """Drag on an element between two places, parts of its width and height."""
    what.scroll_into_view_if_needed()
    box = what.bounding_box()
    (x, y), (to_x, to_y) = (
        (box["x"] + u * box["width"], box["y"] + v * box["height"]) for u, v in (start, end)
    )
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(to_x, to_y, steps=20)
    page.mouse.up()
