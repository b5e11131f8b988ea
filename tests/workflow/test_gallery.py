"""Which scenes of an experiment stand side by side, and in which places."""

import re
from pathlib import Path

import pytest

from tests.refusals import refused
from texgs.config.compose import compose
from texgs.config.project import members
from texgs.core.errors import ConfigError
from texgs.workflow.stage_table import STAGES
from texgs.workflow.sweep import variant_words

GALLERY = STAGES["gallery"]
ENGINE = ("dataset=engine", "fit=quick")


def grids(*words):
    """Of the settings: columns, and for each row its title and what its places show."""
    return [
        (grid["columns"], {row["title"]: row["pictures"] for row in grid["rows"]})
        for grid in GALLERY.settings(compose((*ENGINE, *words)))["grids"]
    ]


def grid(rows, columns="[{}]"):
    return f"gallery.grids=[{{rows: {rows}, columns: {columns}}}]"


def test_each_look_is_there_once_for_each_recipe_that_its_method_takes():
    words = ("fits=[quick,gaussians_quick]", "edits=[glass,lobe,stylesplat]")
    inputs = GALLERY.inputs(compose((*ENGINE, *words)))
    scenes = "results/engine/scene"
    assert {name: path.as_posix() for name, path in inputs.items()} == {
        "quick/none": f"{scenes}/quick/compose/scene.yaml",
        "quick/glass": f"{scenes}/quick/edits/glass/scene.yaml",
        "gaussians_quick/stylesplat": f"{scenes}/gaussians_quick/edits/stylesplat/scene.yaml",
        "volume": "results/engine/volume/volume.nrrd",
    }, "a segment is no look"
    ((columns, rows),) = grids("fits=[quick,demo]", "edits=[glass,gold]")
    assert columns == ["volume", "as fitted", "glass, quick", "glass, demo", "gold, quick", "gold, demo"]
    assert len({tuple(row[0]["view"]) for row in rows.values()}) == 3, "as in the paper's comparisons"
    assert [each["scene"] for each in rows["front"]] == [
        "quick/none",
        "quick/none",
        "quick/glass",
        "demo/glass",
        "quick/gold",
        "demo/gold",
    ]


def test_a_comparison_shows_what_its_looks_were_given():
    words = (*ENGINE, "fits=[quick,gaussians_quick]", "edit.looks=true")
    looks = compose(ENGINE).dataset.looks

    def given(*more):
        settings = GALLERY.settings(compose((*words, *more)))
        return settings["styles"], settings["instructions"]

    styles = {name: look.style for name, look in looks.items()}
    instructions = {name: look.instruction for name, look in looks.items()}
    assert given("edits=[style,stylesplat]") == (styles, {})
    assert given("edits=[text_quick,dge_quick]") == ({}, instructions)
    assert given("edits=[dge_quick,style]") == (styles, instructions)
    assert given("edits=[glass]", "edit.looks=false") == ({}, {}), "each edit follows its own"
    assert given("edits=[style]", grid("[{edit: style}]")) == ({}, {}), "the experiment says what it shows"


def test_what_a_row_and_a_column_say_counts_together_and_the_column_first():
    rows = (
        "[{title: a, light: [1, 2], edit: gold, changes: ['TF01.opacity=0.5']}, "
        "{title: b, show: error, fov_y: 20}]"
    )
    columns = (
        "[{title: x, light: [3, 4], changes: ['TF02.visible=false']}, {title: y, edit: none, show: volume}]"
    )
    ((titles, by_row),) = grids("edits=[gold]", grid(rows, columns))
    assert titles == ["x", "y"]
    (ax, ay), (bx, by) = by_row["a"], by_row["b"]
    assert (ax["scene"], ax["show"], ax["light"]) == ("quick/gold", "scene", [3, 4])
    assert ax["changes"] == ["TF01.opacity=0.5", "TF02.visible=false"]
    assert (ay["scene"], ay["show"], ay["light"]) == ("quick/none", "volume", [1, 2])
    assert (bx["show"], bx["fov_y"], bx["view"]) == ("error", 20, [-90, 20])
    assert by["show"] == "", "a row of errors has none in the column of the volume"


def test_without_a_volume_its_rows_and_columns_are_left_out(tmp_path):
    words = ("dataset=vortex", "tf=TF01", f"data_folder={tmp_path}", "edits=[gold]")
    given = grid("[{title: a}, {title: b, show: error}]", "[{title: x, show: volume}, {title: y}]")
    (tmp_path / "vortex" / "TF01").mkdir(parents=True)
    (tmp_path / "vortex" / "TF01" / "transforms_train.json").write_text("{}")
    ((titles, by_row),) = grids(*words, given)
    assert (titles, list(by_row)) == (["y"], ["a"])
    refused(lambda: grids(*words, grid("[{show: volume}]")), "expected a picture in a row", ConfigError)


def test_a_sweep_shows_its_variants_once():
    words = ("dataset=engine", "fit=quick", "sweep=resolution")
    given = grid("[{}]", '[{variant: "400"}, {variant: "800"}]')
    first = compose((*words, given, "variant=400"))
    assert GALLERY.applies(first)
    assert not GALLERY.applies(compose((*words, given, "variant=800")))
    assert not GALLERY.applies(compose((*words, given, "variant=400", "fit.seed=1")))
    assert [path.as_posix() for path in GALLERY.inputs(first).values()] == [
        "results/engine/scene/quick-400/compose/scene.yaml",
        "results/engine/scene/quick-800/compose/scene.yaml",
    ]


@pytest.mark.parametrize(
    ("stage", "words", "applies"),
    [
        ("gallery", ("fit=quick",), True),
        ("gallery", ("fit=gaussians_quick",), False),  # the first one stands for all
        ("gallery", ("fit=quick", "edits=[glass]"), False),
        ("gallery", ("fit=quick", "edits=[glass]", grid("[{edit: glass}]")), True),
        ("gallery", ("fit=quick", "tf=TF01"), False),
        ("comparison", ("tf=TF01", "fit=quick"), True),
        ("comparison", ("tf=TF01", "fit=gaussians_quick"), False),
        ("comparison", ("tf=TF01", "fit=quick", "fits=[quick]"), False),
        ("comparison", ("tf=TF01", "fit=quick", "edit=glass"), False),
    ],
)
def test_one_configuration_stands_for_all(stage, words, applies):
    given = ("dataset=engine", "fits=[quick,gaussians_quick]", "edits=[glass,stylesplat]")
    assert STAGES[stage].applies(compose((*given, *words))) is applies


def test_models_of_a_comparison_are_those_of_the_last_phases_of_all_recipes():
    words = ("dataset=engine", "tf=TF01", "fits=[quick,gaussians_quick]", "fit=gaussians_quick", "fit.seed=3")
    assert {name: path.as_posix() for name, path in STAGES["comparison"].inputs(compose(words)).items()} == {
        "quick": "results/engine/TF01/quick-s3/texture/model.safetensors",
        "gaussians_quick": "results/engine/TF01/gaussians_quick-s3/gaussians/model.safetensors",
        "views": "results/engine/TF01/views-one-light/transforms_train.json",  # those of the fit named
    }


@pytest.mark.parametrize(
    ("rows", "words", "message"),
    [
        ("[{edit: glas}]", "edits=[glass]", r"\.edit: expected one of none, glass, got glas, did"),
        ("[{edit: stylesplat}]", "edits=[stylesplat]", r"\.edit: stylesplat works on none of quick; add a"),
        ("[{fit: demos}]", "fits=[quick,demo]", r"\.fit: expected one of quick, demo, got demos"),
        (
            *("[{edit: glass, fit: plenoxels}]", "fits=[quick,plenoxels] edits=[glass]"),
            r"\.fit: glass does not work on plenoxels",
        ),
        ("[{variant: a}]", "", r"\.variant: expected none without a sweep, got a"),
        ("[{}]", "sweep=resolution variant=400", "variant: expected one of 400, 800, 1200, got none"),
        ("[{light: [3]}]", "", r"\.light: expected azimuth and polar angle, .*, got \[3"),
        ("[{view: [1, 200]}]", "", r"\.view: expected .* from -90 to 90 degrees, got \[1"),
        ("[{box: [0.5, 0.5, 0.6]}]", "", r"\.box: expected left, top and side, from 0 to 1"),
        ("[{show: volum}]", "", "show: expected one of scene, volume, error, got volum, did you mean volume"),
        ("[{title: a}, {title: a}]", "", "expected rows with different titles, got 'a' twice"),
        ("[]", "", "expected a picture in a row and a column, got none"),
        ("", "", "edits: expected some to show"),
        ("", "gallery.grids=[{name: a/b}]", "expected different names of files, got 'a/b'"),
        ("", "gallery.grids=[{},{}]", "expected different names of files, got 'pictures'"),
        ("", "gallery.name=sheet", "gallery.name: sheet is a folder of texgs"),
    ],
)
def test_a_mistake_is_one_sentence(rows, words, message):
    given = (words,) if "{" in words else words.split()
    words = (*ENGINE, *given, *([grid(rows)] if rows else ()))
    refused(lambda: GALLERY.inputs(compose(words)), message, ConfigError)


def test_without_an_edit_the_scene_is_shown_as_it_is_fitted():
    ((_, rows),) = grids("edits=[none]")
    assert [place["scene"] for place in rows["front"] if place["show"] == "scene"] == ["quick/none"]


def shown():
    """Experiments with a gallery of their own, and a data set of each."""
    configs = {name: compose((f"experiment={name}",)) for name in members("experiment")}
    named = {name: each for name, each in configs.items() if each.gallery.name != "looks"}
    return [(name, each.datasets[0]) for name, each in named.items()]


@pytest.mark.parametrize(("experiment", "dataset"), shown())
def test_every_experiment_with_a_gallery_is_named_like_it_and_shows_scenes_of_its_own(
    experiment, dataset, tmp_path
):
    (tmp_path / "vortex" / "TF01").mkdir(parents=True)
    (tmp_path / "vortex" / "TF01" / "transforms_train.json").write_text("{}")
    words = (f"experiment={experiment}", f"dataset={dataset}", f"data_folder={tmp_path}")
    config = compose(words)
    variant = next(iter(variant_words(config)), "")
    config = compose((*words, f"variant={variant}", *(f"fit={name}" for name in config.fits[:1])))
    assert config.gallery.name == experiment
    assert GALLERY.applies(config)
    settings = GALLERY.settings(config)
    assert settings["command"] == f"texgs run experiment={experiment}"
    assert all(each["caption"] for each in settings["grids"])
    assert GALLERY.inputs(config)


def test_the_example_of_the_page_works(tmp_path, monkeypatch):
    page = (Path(__file__).parents[2] / "docs" / "report.md").read_text(encoding="utf-8")
    (example,) = re.findall("```yaml\n(.*?)```", page, flags=re.DOTALL)
    (tmp_path / "conf" / "experiment").mkdir(parents=True)
    (tmp_path / "conf" / "experiment" / "opacity.yaml").write_text(example)
    monkeypatch.chdir(tmp_path)
    settings = GALLERY.settings(compose(("experiment=opacity", "dataset=engine")))
    assert settings["command"] == "texgs run experiment=opacity"
