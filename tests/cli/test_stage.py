"""The verbs of the stages, by hand: what they write, when they do nothing, and what survives a kill."""

import shlex

import numpy as np
import pytest

from tests.cli.conftest import SPHERE, numbers
from texgs.cli.main import main
from texgs.config.compose import compose
from texgs.core.cache import sha256
from texgs.core.errors import DeviceError
from texgs.core.io import read_json
from texgs.core.light import HEADLIGHT, Light, random_lights
from texgs.core.names import METRICS
from texgs.volume import view_files
from texgs.volume.framing import frame_of
from texgs.volume.nrrd_file import open_grid
from texgs.volume.transfer import TransferFunction
from texgs.volume.view_set import read_views
from texgs.workflow.job import settings_file
from texgs.workflow.stage_table import STAGES

TINY = [*SPHERE, "dataset.volume.size=24", "views.height=32", "views.step=0.5", "views.radius=4.0311"]
TINY.append("views.relit=0")


class Blank:
    """A renderer that sees nothing."""

    local_viewer = False

    def render(self, _tf, camera, _light):
        return np.zeros((camera.height, camera.width, 4), np.float32)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path / "results" / "sphere"


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


def test_views_show_what_all_transfer_functions_show(folder):
    """From one place, which is that of the frame of both."""
    outer = "dataset.basic_tfs.TF01.opacity=[[0.01, 0.5], [0.1, 0.5]]"
    inner = "+dataset.basic_tfs.TF02={opacity: [[0.9, 0], [0.95, 1], [1, 1]], color: [[0.9, 1, 0, 0]]}"
    assert main(["views", *TINY, outer, inner, "views.radius=null", "views.step=0.25"]) == 0
    views = {tf: read_views(folder / tf / "views") for tf in ("TF01", "TF02")}
    told = [each.metadata["tf"] for each in views.values()]
    tfs = [TransferFunction(tf["opacity"], tf["color"]) for tf in told]
    lens = frame_of(open_grid(folder / "volume" / "volume.nrrd"), tfs).lens(30.0, 48, 32)
    for each in views.values():
        assert float(each.train[0].camera.position.norm()) == pytest.approx(lens.radius, rel=1e-4)


def test_a_second_time_does_nothing_and_force_does_it_again(folder, capsys):
    times = []
    for words in ([], [], ["--force"]):
        assert main(["volume", *words, *TINY]) == 0
        times.append((folder / "volume" / "volume.nrrd").stat().st_mtime_ns)
        assert ("up to date" in capsys.readouterr().out) == (len(times) == 2)
    assert times[0] == times[1] < times[2]


def test_a_volume_that_memory_does_not_hold_is_told(folder, capsys, monkeypatch):
    assert main(["volume", *TINY]) == 0
    assert "GiB" not in capsys.readouterr().err
    monkeypatch.setattr("texgs.workflow.stages.volume.free_memory", lambda: 10_000)
    assert main(["volume", "--force", *TINY]) == 0
    assert "dataset.volume.reduce=2 makes it smaller" in capsys.readouterr().err


def test_results_of_other_settings_are_replaced_on_request_alone(folder, capsys):
    """A verb that needs the views would render other ones; none of them mixes with what is there."""
    assert main(["sheet", *TINY]) == 0
    capsys.readouterr()
    views = next(folder.glob("*/views"))
    before = checksums_below(folder)
    fewer = ["views.train.kind=orbit", "views.train.count=2"]
    for verb in (["sheet"], ["views", "--force"]):
        assert main([*verb, *TINY, *fewer]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.count("\n") == 1
        for told in (
            "/TF01/views ",
            "views.train.count is 61, not 2",
            "--replace",
            f" {TINY[-1]} ",
            "tf=TF01",
        ):
            assert told in said.err
    assert checksums_below(folder) == before
    assert main(["sheet", "--replace", *TINY, *fewer]) == 0
    assert len(list((views / "train").iterdir())) == len(read_views(views).train) == 2


def test_a_result_names_the_command_that_does_nothing_but_make_it(folder):
    """Whatever asked for it: a sheet of all basic TFs needs views of each."""
    assert main(["sheet", *TINY, "views.seed=3"]) == 0
    before = checksums_below(folder)
    commands = [read_json(path)["command"] for path in folder.rglob(METRICS)]
    assert {command.split()[1] for command in commands} == {"volume", "views", "sheet"}
    for command in commands:
        assert main(shlex.split(command)[1:]) == 0
    assert checksums_below(folder) == before


def checksums_below(folder):
    return {path: sha256(path) for path in folder.rglob("*") if path.is_file() and path.suffix != ".lock"}


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


def test_lights_take_turns_and_test_views_have_their_own(folder):
    lights = "views.lights=[{kind: headlight}, {kind: random}, {kind: directional, azimuth: 9}]"
    main(["views", *TINY, lights, "views.test_lights=[{kind: directional, azimuth: 60, polar: 20}]"])
    views = read_views(next(folder.glob("*/views")))
    drawn = random_lights(12, 0, 0)
    assert [view.light for view in views.train[:6]] == [
        *(HEADLIGHT, drawn[1], Light("directional", 9.0)),
        *(HEADLIGHT, drawn[4], Light("directional", 9.0)),
    ]
    assert {(view.light.kind, view.light.azimuth) for view in views.test} == {("directional", 60.0)}


def some_headlights(lights):
    return [light if index % 18 else HEADLIGHT for index, light in enumerate(lights)]


def test_more_test_views_are_under_lights_that_no_training_view_has(folder):
    main(["views", *TINY, "views.relit=4"])
    views = read_views(next(folder.glob("*/views")))
    assert [view.light for view in views.train] == some_headlights(random_lights(12, 0, 0))
    assert {view.light for view in views.test} == {HEADLIGHT}
    assert [view.light for view in views.relit] == random_lights(4, 0, 2)
    assert not {view.light for view in views.train} & {view.light for view in views.relit}
    main(["views", *TINY, "views.relit=0", "views.seed=1", "--replace"])
    views = read_views(views.folder)
    assert (views.relit, (views.folder / "relit").exists()) == ([], False)
    assert [view.light for view in views.train] == some_headlights(random_lights(12, 1, 0))


@pytest.mark.parametrize("works", [True, False])
def test_vtk_renders_some_views_to_compare_times(folder, capsys, monkeypatch, works):
    shown = []

    def vtk_or_none(kind, *of_volume):
        if kind != "vtk":
            return renderer_for(kind, *of_volume)
        if not works:
            raise DeviceError("offscreen OpenGL: none")
        monkeypatch.setattr(Blank, "render", lambda _self, _tf, camera, _light: shown.append(camera))
        return Blank()

    renderer_for = view_files.renderer_for
    monkeypatch.setattr(view_files, "renderer_for", vtk_or_none)
    assert main(["views", *TINY, "metric.vtk_frames=2"]) == 0
    (views,) = folder.glob("*/views")
    assert len(shown) == 3 * works, "the first one is rendered twice and does not count"
    assert ("vtk_frame_ms" in numbers(views)) == works
    assert ("VTK's time is not measured: offscreen OpenGL: none" in capsys.readouterr().err) != works


def test_empty_views_fail_again_the_same_way(folder, capsys, monkeypatch):
    monkeypatch.setattr(view_files, "renderer_for", lambda *_: Blank())
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
    monkeypatch.setattr(view_files, "renderer_for", lambda *_: Blank())
    assert main(["views", *TINY]) == 0
    assert len(whole["frames_ms"]) == 15 - 1
    resumed = numbers(views)
    assert len(resumed["frames_ms"]) == 15 - 2
    assert resumed["frames_ms"][:10] == whole["frames_ms"][:10]
    assert resumed["first_frame_ms"] == whole["first_frame_ms"]
    alpha = np.stack([view.load()[..., 3].numpy() for view in read_views(views).train])
    assert resumed["coverage"] == pytest.approx((alpha > 0).mean() * 12 / 15)


def test_a_job_of_the_workflow(folder, capsys):
    settings = settings_file(STAGES["volume"].settings(compose(tuple(TINY))), "results")
    output = folder / "elsewhere"
    assert main(["volume", "--settings", settings, "--output", str(output)]) == 0
    assert (output / "volume.nrrd").exists()
    assert main(["views", "--settings", settings, "--output", str(output)]) == 2
    assert "expected the settings of a views job" in capsys.readouterr().err
    assert main(["volume", "--settings", settings, "--output", str(output), "dataset=sphere"]) == 2
    assert main(["volume", "--settings", settings, "--output", str(output), "--force"]) == 2
    assert "expected --settings and --output" in capsys.readouterr().err
    assert main(["volume", *TINY, "--output", str(output)]) == 2
    assert "--input, --output: expected only with --settings" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["dataset.volume.generator=null", "dataset.volume.file=no.nrrd"], "no.nrrd is not there"),
        (["tf=TF09"], "tf: expected a basic TF of data set sphere"),
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
