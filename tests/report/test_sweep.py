import pytest

from tests.fields.surfels.test_composition import ball
from tests.refusals import refused
from tests.report.written import job, metrics, read
from texgs.core.figures import CELL, DPI
from texgs.fields.surfels.model_file import write_model
from texgs.report.results import EditMeasures, EditResult, FitResult
from texgs.report.sweep_figure import PANELS_PER_ROW, WIDTH, sweep_figure
from texgs.report.sweep_table import sweep
from texgs.report.table import SOURCES, Table
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import write_scene

PHASES = ("surfels", "shading", "texture")


def run(folder, variant, seed=0, psnr=30.0, phases=PHASES, sweep="mine"):
    """Return the metrics files of one fit."""
    own = {
        "surfels": {},
        "shading": {"material": dict.fromkeys(("ambient", "diffuse", "specular", "shininess"), 0.5)},
        "texture": {"psnr": psnr, "train_psnr": psnr + 1, "ssim": 0.9},
    }
    facts = {"tf": "TF01", "variant": variant, "sweep": sweep, "seed": seed}
    return [metrics(folder, phase, FitResult(60.0, 1000, **own[phase]), **facts) for phase in phases]


def edit(folder, variant, seed=0, nnfm=0.5):
    """Return the metrics files of one edit and of what was measured of it, in folders of their own."""
    values = {"similarity": 0.25, "style_nnfm": nnfm, "frame_mean_ms": 4.0, "frame_max_ms": 5.0}
    values |= {"primitives": 9, "megabytes": 1.0, "geometry_kept": True}
    result = EditResult("style", "image", "patches", 30.0)
    measures = EditMeasures("style", "image", values=values)
    facts = {"variant": variant, "sweep": "mine", "seed": seed, "fit_seed": 0, "edit": "style"}
    return [job(folder, "edits", result, **facts), job(folder, "edit_metrics", measures, **facts)]


def column(table: Table, title):
    return table.frame[title].tolist()


def test_means_and_spread_over_seeds(tmp_path):
    paths = run(tmp_path, "a", 0, 30.0) + run(tmp_path, "a", 1, 32.0) + run(tmp_path, "b", 0, 20.0)
    table = sweep(read(paths), "mine")
    assert column(table, "variant") == ["a", "b"]
    assert column(table, "seeds") == [2, 1]
    assert column(table, "PSNR") == [31.0, 20.0]
    assert column(table, "PSNR, training") == [32.0, 21.0]
    assert column(table, "± PSNR") == [pytest.approx(2**0.5), None]
    assert column(table, "minutes") == [3.0, 3.0]
    assert column(table, "memory GiB") == [1.0, 1.0]
    assert column(table, "± minutes") == [0.0, None]
    assert "PSNR (paper)" not in [c.title for c in table.columns]


def test_unseen_lights_have_a_column_where_a_fit_was_measured_under_them(tmp_path):
    title = "PSNR under unseen lights"
    before = run(tmp_path, "a", 0)
    assert title not in [each.title for each in sweep(read(before), "mine").columns]
    result = FitResult(60.0, 1000, psnr=30.0, relit_psnr=28.0)
    lit = metrics(tmp_path, "texture", result, tf="TF01", variant="b", sweep="mine", seed=0)
    paths = [*before, *run(tmp_path, "b", 0, phases=PHASES[:2]), lit]
    assert column(sweep(read(paths), "mine"), title) == [None, 28.0]


def test_a_sweep_of_edits_has_their_measures(tmp_path):
    first = edit(tmp_path, "0", 0, 0.7)
    table = sweep(read([*edit(tmp_path, "0.5", 0, 0.4), *edit(tmp_path, "0.5", 1, 0.6), *first]), "mine")
    assert [each.title for each in table.columns][:5] == ["data set", "recipe", "edit", "variant", "seeds"]
    assert column(table, "variant") == ["0", "0.5"], "in the order of their values"
    assert column(table, "seeds") == [1, 2]
    assert column(table, "NNFM") == [0.7, pytest.approx(0.5)]
    assert column(table, "± NNFM") == [None, pytest.approx(0.02**0.5)]
    assert column(table, "minutes") == [0.5, 0.5]
    assert column(table, "Gram") == [None, None]
    assert table.frame[SOURCES][0] == first


def test_the_figure_has_a_panel_for_each_measure_that_differs(tmp_path):
    paths = run(tmp_path, "42", 0, 30.0) + run(tmp_path, "92", 0, 32.0) + run(tmp_path, "92", 1, 33.0)
    width, _ = sweep_figure(read(paths), "mine").size
    assert width == pytest.approx(2 * WIDTH * DPI, abs=1), "PSNR, and that of training views"
    named = run(tmp_path, "a", 0, 30.0, sweep="b") + run(tmp_path, "c", 0, 30.0, sweep="b")
    width, _ = sweep_figure(read(named), "b").size
    assert width == pytest.approx(PANELS_PER_ROW * WIDTH * DPI, abs=1), "all, where none differs"


def test_the_figure_shows_the_scenes_of_edits(tmp_path):
    scene = Scene({"TF01": SceneModel(write_model(tmp_path / "model.safetensors", ball(1)))})
    paths = edit(tmp_path, "0.5") + edit(tmp_path, "1", nnfm=0.3)
    _, without = sweep_figure(read(paths), "mine").size
    for path in paths[::2]:
        write_scene(path.with_name("scene.yaml"), scene)
    _, height = sweep_figure(read(paths), "mine").size
    assert height > without + CELL * DPI


def test_a_variant_with_a_missing_phase_is_not_measured(tmp_path):
    """Nor is a fit of another sweep; an edit has a row of its own."""
    paths = run(tmp_path, "a", phases=("shading",)) + run(tmp_path, "a", sweep="other") + edit(tmp_path, "a")
    table = sweep(read(paths), "mine")
    assert column(table, "seeds") == [0, 1]
    assert column(table, "edit") == ["-", "style"]
    assert column(table, "PSNR") == [None, None]
    assert column(table, "minutes") == [None, 0.5]
    refused(lambda: sweep(read(paths), "none"), "sweep none:")
