from pathlib import Path

import pytest
import yaml

from tests.refusals import refused
from texgs.config.compose import compose
from texgs.config.project import members
from texgs.core.errors import ConfigError
from texgs.core.keys import typed
from texgs.workflow.job import settings_digest, settings_file
from texgs.workflow.locate import source_file, tf_names, views_folder
from texgs.workflow.stage import plain_values
from texgs.workflow.stage_table import STAGES

TF = ("dataset=turbulence", "tf=TF01")
WORDS = {  # of stages that read more than the data set
    **dict.fromkeys(("views", "sheet", "surfels", "shading", "texture", "figure", "mesh"), TF),
    "comparison": (*TF, "fits=[quick,demo]"),
    "gaussians": (*TF, "fit=gaussians_quick"),
    "voxels": (*TF, "fit=plenoxels_quick"),
    "palette": (*TF, "fit=stylerf_quick"),
    **{
        f"edit_{compose((f'edit={name}',)).edit.method}": ("dataset=turbulence", f"edit={name}")
        for name in members("edit")
    },
    "gallery": ("dataset=turbulence", "edits=[gold]"),
    "edit_metrics": ("dataset=turbulence", "edit=gold"),
}


def digest(stage, *overrides):
    return settings_digest(STAGES[stage].settings(compose(("dataset=turbulence", *overrides))))


def test_only_what_a_stage_reads_changes_its_digest():
    views = digest("views", "tf=TF01")
    assert digest("views", "tf=TF01", "tracking=none", "results=elsewhere", "data_folder=x") == views
    assert digest("views", "tf=TF01", "dataset.basic_tfs.TF02.color=[[0.5,1,0,0]]") == views
    other = "dataset.basic_tfs.TF02.opacity=[[0.5,0],[0.6,1]]"
    assert digest("views", "tf=TF01", other) != views, "views are framed by all that is visible"
    assert digest("views", "tf=TF01", "views=paper", other) == digest("views", "tf=TF01", "views=paper")
    assert digest("views", "tf=TF01", "dataset.volume.size=64") == views
    assert digest("views", "tf=TF01", "views.step=0.3") != views
    assert digest("views", "tf=TF01", "dataset.basic_tfs.TF01.opacity=[[0.2,0],[0.3,1]]") != views
    assert digest("views", "tf=TF02") != views
    assert digest("volume", "views=paper") == digest("volume")
    assert digest("volume", "dataset.volume.size=64") != digest("volume")


def test_a_phase_is_not_changed_by_what_later_ones_read():
    """From a recipe as its file has it: the first change of any key must not count for all phases."""
    of_tf = ("tf=TF01", "fit=quick")
    before = {name: digest(name, *of_tf) for name in ("surfels", "shading", "texture", "compose")}
    for change, changed in {
        "fit.texture.sweeps=2": {"texture", "compose"},
        "fit.shading.iterations=10": {"shading", "texture", "compose"},
        "fit.materials=surfel": {"shading", "texture", "compose"},
        "fit.low_pass=3": set(before),
    }.items():
        assert {name for name in before if digest(name, *of_tf, change) != before[name]} == changed, change


@pytest.mark.parametrize(
    ("stage", "words", "reads"),
    [
        ("surfels", "fit=quick", True),
        ("surfels", "fit=quick fit.seeds.kind=visible", False),
        ("surfels", "fit=paper", False),
        ("shading", "fit=quick", True),
        ("shading", "fit=quick fit.attributes=learned", False),
        ("shading", "dataset=vortex fit=quick", False),
        ("gaussians", "fit=gaussians_quick", True),
        ("gaussians", "fit=gaussians", False),
        ("voxels", "fit=plenoxels_quick", False),
    ],
)
def test_a_fit_reads_the_volume_where_it_may_start_from_it(tmp_path, stage, words, reads):
    (tmp_path / "vortex" / "TF01").mkdir(parents=True)
    (tmp_path / "vortex" / "TF01" / "transforms_train.json").write_text("{}")
    config = compose(("dataset=engine", "tf=TF01", f"data_folder={tmp_path}", *words.split()))
    assert ("volume" in STAGES[stage].inputs(config)) == reads


def test_settings_file_is_named_after_its_contents(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    config = compose(("dataset=turbulence", "tf=TF01"))
    settings = STAGES["views"].settings(config)
    path = settings_file(settings, "results")
    assert settings_file(settings, "results") == path
    assert yaml.safe_load(Path(path).read_text()) == settings
    assert settings_digest(settings) in path


def test_basic_tfs_are_those_of_the_data_set_or_the_one_that_is_named():
    assert tf_names(compose(("dataset=turbulence",))) == ["TF01", "TF02"]
    assert tf_names(compose(("dataset=turbulence", "tf=TF02"))) == ["TF02"]
    other = compose(("dataset=turbulence", "tf=TF07"))
    refused(lambda: STAGES["views"].settings(other), r"tf: .* \(TF01, TF02\), got TF07", ConfigError)


def test_a_volume_is_generated_or_a_file(tmp_path):
    assert source_file(compose(("dataset=turbulence",))) is None
    words = ("dataset=turbulence", f"data_folder={tmp_path}", "dataset.volume.file=a.raw")
    refused(lambda: source_file(compose(words)), "expected a generator or a file, got both", ConfigError)
    words = (*words, "dataset.volume.generator=null", "dataset.volume.obtain='ask the author'")
    refused(lambda: source_file(compose(words)), r"a\.raw is not there; ask the author, or ", ConfigError)
    (tmp_path / "a.raw").touch()
    assert source_file(compose(words)) == tmp_path / "a.raw"


def test_a_data_set_may_start_from_views(tmp_path):
    words = ("dataset=turbulence", "dataset.views_folder=mine", f"data_folder={tmp_path}")
    words = (*words, "dataset.volume.obtain='ask the author'")
    of_tf = compose((*words, "tf=TF01"))
    refused(lambda: views_folder(of_tf), r"no views in .*TF01; ask the author, or name", ConfigError)
    (tmp_path / "mine" / "TF01").mkdir(parents=True)
    (tmp_path / "mine" / "TF01" / "transforms_train.json").touch()
    assert views_folder(of_tf) == tmp_path / "mine" / "TF01"
    assert STAGES["sheet"].inputs(of_tf)["views"].parent == tmp_path / "mine" / "TF01"


def is_part(some, whole):
    """Return whether tables, lists and values are those of another table, which may have more keys."""
    if isinstance(some, dict):
        return all(is_part(value, whole[key]) for key, value in some.items())
    if isinstance(some, list):
        return len(some) == len(whole) and all(map(is_part, some, whole))
    return some == whole and type(some) is type(whole)


@pytest.mark.parametrize("name", list(STAGES))
def test_all_settings_have_a_field_of_their_dataclass(name):
    settings = STAGES[name].settings(compose(WORDS.get(name, ("dataset=turbulence",))))
    if STAGES[name].place in ("edit", "edit_metrics"):
        settings["weights"] = {"vgg16": "0123", "lpips_vgg": None}
    assert is_part(settings, plain_values(typed(STAGES[name].schema, settings)))
