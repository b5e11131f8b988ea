"""The verbs of the stages, by hand: what they write, when they do nothing, and what survives a kill."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from texgs.cli.main import main
from texgs.volume.view_set import read_views
from texgs.workflow.result import METRICS
from texgs.workflow.stages import views as views_stage

TINY = [
    "dataset=sphere",
    "dataset.volume.size=24",
    "views=small",
    "views.width=48",
    "views.height=32",
    "views.train.frequency=1",
    "views.test.count=3",
    "views.turntable=2",
    "views.step=0.5",
    "tracking=none",
]


class Blank:
    """A mapper that sees nothing."""

    local_viewer = False

    def render(self, _tf, camera, _light):
        return np.zeros((camera.height, camera.width, 4), np.float32)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path / "results" / "sphere"


def numbers(views):
    """What the stage says about its folder."""
    return json.loads((views / METRICS).read_text())["numbers"]


def images(views):
    """Names and bytes of all images in a folder of views."""
    return {path.relative_to(views): path.read_bytes() for path in views.rglob("*.png")}


def test_views_makes_what_it_needs_first(folder, capsys):
    assert main(["views", *TINY]) == 0
    assert "results/sphere/volume: done" in capsys.readouterr().out
    (tf,) = (path.name for path in folder.glob("TF*"))
    views = read_views(folder / tf / "views")
    assert (len(views.train), len(views.test)) == (12, 3)
    camera = views.train[0].camera
    assert (camera.width, camera.height) == (48, 32)
    assert views.metadata["tf"]["name"] == tf
    assert views.metadata["shading"]["local_viewer"] is False
    assert views.metadata["aabb"] == [[-0.5] * 3, [0.5] * 3]
    alpha = np.stack([view.load()[..., 3].numpy() for view in views.train])
    assert alpha.max() > 127
    assert alpha[:, 0].max() == 0, "the sphere touches the border of the view"


def test_a_second_time_does_nothing_and_force_does_it_again(folder, capsys):
    main(["volume", *TINY])
    written = (folder / "volume" / "volume.nrrd").stat().st_mtime_ns
    main(["volume", *TINY])
    assert "up to date" in capsys.readouterr().out
    assert (folder / "volume" / "volume.nrrd").stat().st_mtime_ns == written
    main(["volume", "--force", *TINY])
    assert (folder / "volume" / "volume.nrrd").stat().st_mtime_ns > written


def test_another_setting_does_not_mix_with_what_is_there(folder):
    main(["views", *TINY])
    (views,) = folder.glob("*/views")
    main(["views", *TINY, "views.train.kind=orbit", "views.train.count=2"])
    assert len(list((views / "train").iterdir())) == 2
    assert len(read_views(views).train) == 2


def test_geometry_of_the_test_views(folder):
    main(["views", *TINY, "views.geometry=true"])
    (views,) = folder.glob("*/views")
    names = sorted(path.name for path in (views / "geometry").iterdir())
    assert names == ["r_0000.npz", "r_0001.npz", "r_0002.npz"]
    with np.load(views / "geometry" / "r_0001.npz") as planes:
        depth, normal = planes["depth"], planes["normal"]
    assert depth.shape == (32, 48)
    assert 3 < depth[16, 24] < 4.0311, "the front of a ball in the middle of the view"
    assert normal[16, 24] @ [1, 0, 0] > 0.9, "test view 1 of 3 is on the +x axis"


def test_empty_views_fail_again_the_same_way(folder, capsys, monkeypatch):
    monkeypatch.setattr(views_stage, "renderer_for", lambda *_: Blank())
    for _ in range(2):
        assert main(["views", *TINY]) == 2
        error = capsys.readouterr().err.splitlines()[-1]
        assert error.endswith("expected to see something, but all views are empty; raise its opacity")
        (work,) = folder.glob("*/.views.work")
        assert len(list(work.glob("train/*.png"))) == 12
        assert not list(folder.rglob("transforms_*.json"))


def test_a_resumed_job_may_have_only_empty_views_left(folder, monkeypatch):
    main(["views", *TINY])
    (views,) = folder.glob("*/views")
    whole = numbers(views)
    lost = [views / "train" / "r_0011.png", *(views / "test").iterdir(), views / METRICS]
    for path in lost:
        path.unlink()
    monkeypatch.setattr(views_stage, "renderer_for", lambda *_: Blank())
    assert main(["views", *TINY]) == 0
    assert len(whole["frames_ms"]) == 15 - 1
    resumed = numbers(views)
    assert len(resumed["frames_ms"]) == 15 - 2
    assert resumed["frames_ms"][:10] == whole["frames_ms"][:10]
    assert resumed["first_frame_ms"] == whole["first_frame_ms"]
    alpha = np.stack([view.load()[..., 3].numpy() for view in read_views(views).train])
    assert resumed["coverage"] == pytest.approx((alpha > 0).mean() * 12 / 15)


def test_a_killed_job_goes_on_where_it_was(folder, tmp_path, monkeypatch):
    """Images and times are kept, and the result is that of an uninterrupted run."""
    words = [
        "views",
        *TINY,
        "views.width=96",
        "views.height=96",
        "views.step=0.2",
        "views.train.frequency=2",
    ]
    command = [sys.executable, "-m", "texgs.cli.main", *words]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    child = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 300
    while time.monotonic() < deadline and len(list(folder.glob("*/.views.work/train/r_*.png"))) < 4:
        time.sleep(0.02)
    child.send_signal(signal.SIGKILL)
    child.communicate()
    (work,) = folder.glob("*/.views.work")
    kept = {path.name: path.stat().st_mtime_ns for path in (work / "train").glob("r_*.png")}
    assert 4 <= len(kept) < 42
    assert not list(folder.glob("*/views"))
    assert main(words) == 0
    (views,) = folder.glob("*/views")
    assert len(read_views(views).train) == 42
    assert all((views / "train" / name).stat().st_mtime_ns == stamp for name, stamp in kept.items())
    assert len(numbers(views)["frames_ms"]) == 42 + 3 - 2, "one time per view, without the first of each run"
    (tmp_path / "other").mkdir()
    monkeypatch.chdir(tmp_path / "other")
    assert main(words) == 0
    (other,) = Path.cwd().glob("results/*/*/views")
    assert len(images(other)) == 42 + 3 + 2 + 1
    assert images(views) == images(other)


def test_a_job_of_the_workflow(folder, capsys):
    from texgs.config.compose import compose
    from texgs.workflow.settings_files import settings_file
    from texgs.workflow.stage_table import STAGES

    settings = settings_file(STAGES["volume"].settings(compose(tuple(TINY))), "results")
    output = folder / "elsewhere"
    assert main(["volume", "--settings", settings, "--output", str(output)]) == 0
    assert (output / "volume.nrrd").exists()
    assert main(["views", "--settings", settings, "--output", str(output)]) == 2
    assert "expected the settings of a views job" in capsys.readouterr().err
    assert main(["volume", "--settings", settings, "--output", str(output), "dataset=sphere"]) == 2
    assert main(["volume", "--settings", settings, "--output", str(output), "--force"]) == 2
    assert "no KEY=VALUE or --force" in capsys.readouterr().err
    assert main(["volume", *TINY, "--output", str(output)]) == 2
    assert "--input, --output: expected only with --settings" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["views.widht=3"], "views.widht: no such key"),
        (["dataset.volume.generator=null", "dataset.volume.file=no.nrrd"], "no.nrrd is not there"),
        (["tf=TF09"], "tf: expected a basic TF of data set sphere"),
        (["views.step=0"], "views.step: expected more than 0, got 0"),
        (["views.lights=[]"], "views.lights: expected at least one light"),
        (
            ["dataset.basic_tfs.TF01.opacity=[[5,0],[6,1]]", "dataset.tf_values=data"],
            "expected a range within",
        ),
    ],
)
def test_mistakes_are_one_sentence(folder, capsys, words, message):
    assert main(["views", *TINY, *words]) == 2
    error = capsys.readouterr().err
    assert message in error.splitlines()[-1]
    assert "Traceback" not in error


def test_help_lists_every_key(capsys):
    with pytest.raises(SystemExit):
        main(["views", "--help"])
    out = capsys.readouterr().out
    assert "views.fov_y=30.0" in out
    assert "dataset=" in out
