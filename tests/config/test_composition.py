"""Compositions are those that Hydra makes; references stand for other keys."""

from dataclasses import asdict

import pytest
from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from omegaconf import OmegaConf

from texgs.config.compose import compose
from texgs.config.composition import composition, merge, resolve
from texgs.config.project import ROOT
from texgs.config.schema import Config
from texgs.core.errors import ConfigError

SHIPPED = ROOT / "conf"


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("experiment=demo", "fit=quick"),
        ("dataset=engine", "edit=text_untextured", "++edit.seed=3", "device=cuda"),
        ("experiment=lambda_s", "edit=wooden_mosaic"),
        ("edit=style_paper", "fit=paper_short", "dataset=fuel"),
        ("experiment=paper_scenes", "++views.lights=[{kind: directional}]", "++fit.texture={sweeps: 7}"),
        ("experiment=failures", "tracking=none"),
        ("++views.width=7", "++views.width=8", "++views.width=7"),
    ],
)
def test_a_composition_is_that_of_hydra(words):
    with initialize_config_dir(str(SHIPPED), version_base="1.3"):
        by_hydra = OmegaConf.to_container(hydra_compose("config", overrides=list(words)))
    expected = asdict(Config())
    merge(expected, by_hydra)
    assert composition(words, (SHIPPED,)) == resolve(expected)


def test_files_of_the_first_folder_count(tmp_path):
    (tmp_path / "views").mkdir()
    (tmp_path / "views" / "mine.yaml").write_text("width: 5\n")
    (tmp_path / "views" / "default.yaml").write_text("width: 777\n")
    (tmp_path / ".#mine.yaml").symlink_to("me@machine.4711")  # by which an editor locks a file
    places = tmp_path, SHIPPED
    assert composition(("views=mine",), places)["views"]["width"] == 5
    assert composition((), places)["views"]["width"] == 777


def test_tables_of_one_type_are_not_one():
    config = compose(("fit.shading.iterations=10",))
    assert config.fit.surfels.iterations != 10


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
    assert compose(("fit=quick", "results=out/${fit.name}")).results == "out/quick"
    assert compose((r"results='\${fit.name}'",)).results == "${fit.name}"


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("views.width='???'", r"views\.width: expected an integer, got '\?\?\?'"),
        ("fit.seed=${views.widht}", r"fit\.seed: \$\{views\.widht\} refers to views\.widht, which is no key"),
        ("fit.seed=${fit.seed}", r"fit\.seed: \$\{fit\.seed\} refers to itself; write a value"),
        ("sweeps.lambda=engine", r"sweeps\.lambda: no such key"),
        ("dataset.basic_tfs.TF7.opacity=[]", r"dataset\.basic_tfs\.TF7\.opacity: no such key"),
        ("views.lights.3.kind=headlight", r"views\.lights\.3\.kind: no such key"),
        ("~views.widht", r"views\.widht: no such key"),
    ],
)
def test_a_word_that_cannot_be_done_is_one_sentence(word, message):
    with pytest.raises(ConfigError, match=message):
        compose((word,))


def test_a_plus_adds_a_name():
    assert compose(("+sweeps.lambda=engine",)).sweeps == {"lambda": "engine"}
    assert compose(("views.lights.0.azimuth=3",)).views.lights[0].azimuth == 3
