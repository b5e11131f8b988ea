import subprocess
import sys
from dataclasses import FrozenInstanceError
from itertools import product

import pytest

from texgs.config.compose import compose
from texgs.config.describe import describe, keys
from texgs.config.project import groups, members
from texgs.core.errors import ConfigError

GROUPS = ("dataset", "device", "experiment", "tracking", "views")


@pytest.mark.parametrize("choice", [f"{group}={name}" for group in GROUPS for name in members(group)])
def test_every_file_composes(choice):
    assert compose((choice,)).dataset.name


def test_groups_combine():
    for views, tracking in product(members("views"), members("tracking")):
        config = compose((f"views={views}", f"tracking={tracking}", "experiment=demo"))
        assert (config.tracking.uri is None) == (tracking == "none")
    assert compose(("experiment=demo", "views=paper")).views.train.frequency == 4, (
        "a word beats the experiment"
    )


def test_a_copied_file_does_not_take_the_place_of_its_original(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "conf" / "fit").mkdir(parents=True)
    (tmp_path / "conf" / "fit" / "mine.yaml").write_text("defaults: [quick]\ntexture: {sweeps: 1}\n")
    with pytest.raises(
        ConfigError, match=r"fit=mine: expected `name: mine` in its file, got quick; change it"
    ):
        compose(("fit=mine",))
    assert compose(("fit=mine", "fit.name=other")).fit.name == "other"


def test_interpolations_are_resolved():
    config = compose(("dataset.image=300", "results=elsewhere"))
    assert (config.views.width, config.views.height) == (300, 300)
    assert config.tracking.uri == "sqlite:///elsewhere/mlflow.db"


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("views.widht=3", "views.widht: no such key, did you mean views.width?"),
        ("+views.foo=1", "views.foo: no such key"),
        ("views.width=abc", "views.width: expected an integer, got 'abc'"),
        ("views.width=1.5", "views.width: expected an integer, got 1.5"),
        ("views.width=0", "views.width: expected at least 1, got 0"),
        ("views.step=0", "views.step: expected more than 0, got 0"),
        ("views.fov_y=180", "views.fov_y: expected less than 180, got 180"),
        ("views.shading.ambient=inf", "views.shading.ambient: expected a finite number, got inf"),
        ("dataset.name=../../x", "dataset.name: expected a letter and then letters"),
        ("dataset.name=logs", "dataset.name: logs is a folder of texgs"),
        ("dataset.name=Logs", "dataset.name: Logs is a folder of texgs"),
        ("dataset=123", "expected the name of a file of conf/"),
        ("tracking=http://x", "an address goes to tracking.uri"),
        ("views.mapper=gpuu", "views.mapper: expected one of cpu, gpu, vtk, got gpuu, did you mean gpu?"),
        ("dataset=turbulnce", "turbulnce, did you mean turbulence?"),
        ("views=hugge", "views: expected one of default, paper, relight, small, unseen, got hugge"),
        (
            "views.lights=[{kind: sun}]",
            "views.lights.0.kind: expected one of headlight, directional, got sun",
        ),
        ("views.train.kind=ico", "views.train.kind: expected one of icosphere, spiral, orbit, got ico"),
        ("a=b=c", "a=b=c: expected key=value"),
        ("views", "views: expected key=value"),
        ("nonsense=1", "nonsense: no such key"),
        ("mesh.tfs=[TF3]", "mesh.tfs: expected some of TF01, TF02, got TF3"),
    ],
)
def test_a_mistake_is_one_sentence_that_names_the_key(override, message):
    with pytest.raises(ConfigError) as error:
        compose((override,))
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_views_have_no_volume_that_meshes_are_compared_with():
    with pytest.raises(ConfigError, match=r"mesh\.tfs: data set vortex starts from views and has no volume"):
        compose(("dataset=vortex", "mesh.tfs=[TF01]"))


def test_the_composition_cannot_be_changed():
    with pytest.raises(FrozenInstanceError):
        compose().views.width = 3


def test_every_key_says_what_it_means():
    for entry in keys():
        assert entry.help, entry.name
    assert len({entry.name for entry in keys()}) == len(keys())
    text = describe(compose())
    assert "views.fov_y=30.0" in text
    assert "views.test.kind=spiral" in text
    assert "tracking.uri=sqlite:///results/mlflow.db" in text
    assert "[degrees]" in text
    assert "dataset=" in groups()


def test_config_is_light():
    """A Snakefile imports it in every job."""
    code = (
        "import sys; import texgs.workflow.stage, texgs.config.compose;"
        "heavy = {'torch', 'kornia', 'numpy', 'mlflow', 'pyvista', 'vtkmodules'};"
        "print(*(heavy & {name.split('.')[0] for name in sys.modules}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
