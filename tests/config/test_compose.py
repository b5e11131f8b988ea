"""One configuration of files and words, as Hydra makes it; a mistake is a sentence that names the key."""

import subprocess
import sys
from dataclasses import asdict
from itertools import zip_longest

import pytest
from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from omegaconf import OmegaConf

from tests.refusals import refused
from texgs.config.compose import compose
from texgs.config.composition import composition, merge, resolve
from texgs.config.describe import describe, keys
from texgs.config.project import ROOT, groups
from texgs.config.schema import Config
from texgs.core.errors import ConfigError

SHIPPED = ROOT / "conf"
MANY = "9" * 400


def test_a_word_beats_the_experiment():
    config = compose(("views=paper", "tracking=none", "experiment=demo"))
    assert (config.views.train.frequency, config.tracking.uri) == (4, None)


@pytest.mark.parametrize(
    ("words", "radius", "frequency"),
    [
        (("fit=quick",), None, 4),
        (("fit=paper",), 4.0311, 4),
        (("fit=paper_quarter", "edit=glass"), 4.0311, 4),
        (("fit=paper", "views=small"), None, 2),
        (("experiment=texture", "fit=paper"), 4.0311, 4),
    ],
)
def test_the_paper_s_recipe_takes_its_162_views_unless_others_are_named(words, radius, frequency):
    views = compose(words).views
    assert (views.radius, views.train.frequency) == (radius, frequency)
    assert all(light.kind == "headlight" for light in views.lights) == (radius is not None)


def test_a_copied_file_does_not_take_the_place_of_its_original(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "conf" / "fit").mkdir(parents=True)
    (tmp_path / "conf" / "fit" / "mine.yaml").write_text("defaults: [quick]\ntexture: {sweeps: 1}\n")
    refused(lambda: compose(("fit=mine",)), "fit=mine: .*, got quick", ConfigError)
    assert compose(("fit=mine", "fit.name=other")).fit.name == "other"


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("views.widht=3", "views.widht: no such key, did you mean views.width?"),
        ("views.width=abc", "views.width: expected an integer, got 'abc'"),
        ("views.width=0", "views.width: expected at least 1, got 0"),
        ("views.shading.ambient=inf", "views.shading.ambient: expected a finite number, got inf"),
        ("dataset.name=../../x", "dataset.name: expected a letter and then letters"),
        ("dataset.name=logs", "dataset.name: logs is a folder of texgs"),
        ("dataset=123", "dataset: expected the name of a file of conf/, such as dataset=engine, got 123"),
        ("tracking=http://x", "an address goes to tracking.uri"),
        ("views.renderer=gpuu", "views.renderer: expected one of cpu, gpu, vtk, got gpuu, did you mean gpu?"),
        ("dataset=turbulnce", "turbulnce, did you mean turbulence?"),
        ("views=hugge", "views: expected one of default, headlight, paper, relight, small, got hugge"),
        ("views.lights=[{kind: sun}]", "views.lights.0.kind: expected one of headlight"),
        ("a=b=c", "a=b=c: expected key=value"),
        ("dataset=[engine,sphere]", "dataset: expected one name, got a list; several go to datasets"),
        ("edit.text.instruction=dark, red!", "needs quotes inside those of the shell, such as 'edit.text"),
        ("views.mapper=gpu", "views.mapper: this key is called views.renderer now"),
        ("mesh.tfs=[TF3]", "mesh.tfs: expected some of TF01, TF02, got TF3"),
        ("dataset=vortex|mesh.tfs=[TF01]", "mesh.tfs: data set vortex starts from views and has no volume"),
        ("views.width='???'", "views.width: expected an integer, got '???'"),
        ("fit.seed=${views.widht}", "fit.seed: ${views.widht} refers to views.widht, which is no key"),
        ("fit.seed=${fit.seed}", "fit.seed: ${fit.seed} refers to itself; write a value"),
        ("sweeps.lambda=engine", "sweeps.lambda: no such key"),
        ("dataset.basic_tfs.TF7.opacity=[]", "dataset.basic_tfs.TF7.opacity: no such key"),
        ("views.lights.18.kind=headlight", "views.lights.18.kind: no such key"),
        (f"views.fov_y={MANY}", "views.fov_y: expected a finite number, got 9999"),
        ("dataset.volume.spacing=[nan,1,inf]", "dataset.volume.spacing: expected a finite number, got nan"),
        (f"views.width={'9' * 5000}", "Exceeds the limit (4300 digits)"),
        (f"dataset.title={'[' * 3000}", "expected key=value"),
        (f"dataset.title={'[' * 3000}{']' * 3000}", "recursion"),
        ("views=[1,2]", "views: expected one name, got a list"),
        ("dataset.name=" + "a" * 300, "dataset.name: expected at most 100 characters, got 300"),
        ("dataset.name=inf", "dataset.name: inf is a word that YAML or Hydra"),
    ],
)
def test_a_mistake_is_one_sentence_that_names_the_key(override, message):
    with pytest.raises(ConfigError) as error:
        compose(tuple(override.split("|")))
    assert message in str(error.value)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 500


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


def test_planning_is_light():
    """A Snakefile composes in each run and checks what it is to do, edits too: torch alone takes 2 s."""
    code = """
import sys
from texgs.config.compose import compose
from texgs.config.project import members
from texgs.edit.method import methods
from texgs.workflow.stage import Stage
print(*({'torch', 'kornia', 'numpy', 'mlflow', 'pyvista', 'vtkmodules'} & {*sys.modules}))
for name in {*members('edit')} - {'none'}:
    edit = compose(('dataset=engine', f'edit={name}')).edit  # a part of which has clicks
    methods()[edit.method].of(edit).check()
print('torch' in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"]


@pytest.mark.parametrize("verb", ["render", "new", "edit"])
def test_mistyped_options_are_told_at_once(verb):
    """Importing torch alone would take 2 s."""
    code = f"""
import sys
from texgs.cli.main import main
try:
    main(['{verb}', '--no-such-option'])
finally:
    print(*({{'torch', 'numpy', 'cv2', 'PIL'}} & {{*sys.modules}}))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout.split()) == (2, [])


WORDS = [  # files and keys together
    (),
    ("experiment=demo", "fit=quick"),
    ("dataset=engine", "edit=text_untextured", "++edit.seed=3", "device=cuda"),
    ("edit=style_paper", "fit=paper_quarter", "dataset=fuel"),
    ("experiment=paper_scenes", "++views.lights=[{kind: directional}]", "++fit.texture={sweeps: 7}"),
    ("++views.width=7", "++views.width=8", "++views.width=7"),
]


def test_every_composition_is_that_of_hydra(monkeypatch):
    """Of each file of conf/: experiments choose others, which are taken one of each group together."""
    monkeypatch.delenv("TEXGS_DATA", raising=False)
    choices = {
        group.name: [f"{group.name}={path.stem}" for path in sorted(group.glob("*.yaml"))]
        for group in sorted(SHIPPED.iterdir())
        if group.is_dir()
    }
    experiments = zip(choices.pop("experiment"))
    together = ([*filter(None, words)] for words in zip_longest(*choices.values()))
    with initialize_config_dir(str(SHIPPED), version_base="1.3"):
        for words in map(tuple, (*experiments, *together, *WORDS)):
            expected = asdict(Config())
            merge(expected, OmegaConf.to_container(hydra_compose("config", overrides=list(words))))
            assert composition(words, (SHIPPED,)) == resolve(expected), words
            assert compose(words), "types and values are right, too"


def test_files_of_the_first_folder_count(tmp_path):
    (tmp_path / "views").mkdir()
    (tmp_path / "views" / "mine.yaml").write_text("width: 5\n")
    (tmp_path / "views" / "default.yaml").write_text("width: 777\n")
    (tmp_path / ".#mine.yaml").symlink_to("me@machine.4711")  # by which an editor locks a file
    places = tmp_path, SHIPPED
    assert composition(("views=mine",), places)["views"]["width"] == 5
    assert composition((), places)["views"]["width"] == 777


def test_the_folder_of_data_is_that_of_the_environment(monkeypatch):
    for folder in ("/first", "/second"):
        monkeypatch.setenv("TEXGS_DATA", folder)
        assert compose().data_folder == folder
    assert compose(("data_folder=mine",)).data_folder == "mine"


@pytest.mark.parametrize(
    ("words", "key", "expected"),
    [
        (("edit=glass", "edit.seed=${fit.seed}", "fit.seed=7"), "edit", 7),
        (("fit=quick", "fit.seed=${views.width}", "views.width=41"), "fit", 41),
        (("fit=quick", "fit.seed=${edit.seed}", "edit.seed=${views.height}", "dataset.image=9"), "fit", 9),
        (("fit=quick", "fit.seed='${oc.env:SEED,41}'"), "fit", 41),
    ],
)
def test_values_may_refer_to_others(words, key, expected):
    assert getattr(compose(words), key).seed == expected


def test_references_stand_in_texts_and_behind_a_backslash_for_themselves():
    assert compose(("fit=quick", "results=out/${fit.name}")).tracking.uri == "sqlite:///out/quick/mlflow.db"
    assert compose((r"results='\${fit.name}'",)).results == "${fit.name}"


def test_a_plus_adds_a_name():
    assert compose(("+sweeps.lambda=engine",)).sweeps == {"lambda": "engine"}
    assert compose(("views.lights.0.azimuth=3",)).views.lights[0].azimuth == 3


def test_random_lights_are_headlights_for_fields_that_cannot_be_relit():
    def views(*words):
        views = compose(words).views
        return views.name, [light.kind for light in views.lights], views.relit

    assert views() == ("views", ["headlight"] + ["random"] * 17, 24)
    assert views("fit=gaussians") == ("views-one-light", ["headlight"] * 18, 0)
    mixed = "views.lights=[{kind: directional}, {kind: random}]"
    assert views("fit=plenoxels", mixed) == ("views-one-light", ["directional", "headlight"], 0)
    assert views("fit=gaussians", "views=paper") == ("views", ["headlight"], 24)
