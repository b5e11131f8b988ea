"""Scenes of a report in a browser: held or beside it, they open by one button, wholly on the screen."""

import pytest

from tests.report.written import job
from texgs.report import sections
from texgs.report.html import write_report
from texgs.report.metrics_files import read_known
from texgs.report.results import PageResult

pytestmark = pytest.mark.browser


@pytest.mark.parametrize("room", [10**6, 0])
@pytest.mark.parametrize(("width", "height"), [(1400, 900), (400, 800)])
def test_an_opened_scene_is_on_the_screen(chromium, tmp_path, monkeypatch, room, width, height):
    paths = []
    for name in ("none", "gold", "glass"):
        (tmp_path / name).mkdir()
        path = job(tmp_path / name, "page", PageResult(name, 9, 1.0), ["poster.png"])
        path.with_name("scene.html").write_text(f"<!doctype html><h1>{name}</h1>")
        paths.append(path)
    monkeypatch.setattr(sections, "MAILED", room)
    report = write_report(tmp_path / "report.html", read_known(paths)[0])
    page = chromium.new_page(viewport={"width": width, "height": height})
    page.goto(report.as_uri())
    assert page.get_by_role("button", name="Open the scene").count() == 3
    page.get_by_role("button", name="Open the scene").last.click()
    opened = page.locator("iframe")
    assert page.frame_locator("iframe").locator("h1").inner_text() == "gold"
    box = opened.bounding_box()
    assert box["y"] >= 0
    assert box["y"] + box["height"] <= height
    page.close()
