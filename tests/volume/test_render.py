import json

import numpy as np
import pytest

from texgs.core.camera import orbit
from texgs.core.light import HEADLIGHT
from texgs.volume import render
from texgs.volume.render import Times, render_views
from texgs.volume.view_set import View


class Grey:
    """A renderer whose images say how many it has made."""

    local_viewer = False

    def __init__(self, made=0):
        self.made = made

    def render(self, _tf, camera, _light):
        self.made += 1
        return np.full((camera.height, camera.width, 4), self.made / 255, np.float32)


@pytest.fixture
def views(tmp_path):
    camera = orbit(0, 0, 3.5, 30, 5, 4)
    return [View(camera, tmp_path / "train" / f"r_{index:04}.png", HEADLIGHT) for index in range(6)]


def levels(views):
    return [int(view.load()[0, 0, 3]) for view in views if view.path.exists()]


def test_an_interruption_loses_no_file_and_no_time(views, tmp_path, monkeypatch):
    def interrupted(path, *planes):
        if path == views[3].path:
            raise KeyboardInterrupt
        return write_png(path, *planes)

    write_png = render.write_png
    monkeypatch.setattr(render, "write_png", interrupted)
    with pytest.raises(KeyboardInterrupt):
        render_views(Grey(), None, views, "all", Times(tmp_path / "times.json"))
    monkeypatch.undo()
    before = json.loads((tmp_path / "times.json").read_text())
    times = Times(tmp_path / "times.json")
    assert len(times.first) == 1
    assert len(times.others) == 3
    render_views(Grey(10), None, views, "all", times)
    assert levels(views) == [1, 2, 3, 11, 12, 13]
    after = json.loads((tmp_path / "times.json").read_text())
    assert list(after) == [f"train/r_{index:04}.png" for index in range(6)]
    assert list(after.values())[:3] == list(before.values())[:3]
    assert [entry["is_first"] for entry in after.values()] == [True, False, False, True, False, False]
    assert times.first == [entry["ms"] for entry in after.values() if entry["is_first"]]
    assert times.others == [entry["ms"] for entry in after.values() if not entry["is_first"]]
