"""What the paper's figures show with its data and weights, and what stands in where these are missing."""

import hashlib
import os
import re
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from tests.refusals import refused
from tests.shipped import DATASETS, ROOT
from texgs.config.case import Case
from texgs.config.compose import compose
from texgs.core.errors import ConfigError
from texgs.models import weights
from texgs.models.catalogue import CATALOGUE, Single
from texgs.workflow.cases import cases_of
from texgs.workflow.edits import edits_of
from texgs.workflow.missing import lacking
from texgs.workflow.plan import make, words_of
from texgs.workflow.stage import edit_folder, fit_folder

SHARES = {f"style_paper-{value}" for value in ("0", "0.5", "0.9", "1")}
# What an edit as in the paper has, by its method.
RECIPES = {
    "image": {"recipe": "paper"},
    "text": {"recipe": "paper", "guidance": "instruct_pix2pix", "negative": ""},
    "segment": {"masks": "sam_vit_h", "vote": "centre", "voters": "training", "connected": False},
}
ALL = tuple(CATALOGUE)


def put_volumes(folder):
    """Make a few random bytes of each volume, and a place for the published views."""
    for name in DATASETS:
        dataset = yaml.safe_load((ROOT / "conf" / "dataset" / f"{name}.yaml").read_text(encoding="utf-8"))
        if file := dataset.get("volume", {}).get("file"):
            (folder / file).write_bytes(os.urandom(64))
    for tf in ("TF01", "TF02"):
        (folder / "vortex" / tf).mkdir(parents=True)
        (folder / "vortex" / tf / "transforms_train.json").write_text("{}")


def put_weights(folder, names, patch):
    """Make a few random bytes of weights, which the catalogue then knows by their checksums."""
    patch.setattr(
        weights, "find_spec", lambda package: package, raising=False
    )  # what reads them is installed
    for name in names:
        entry, content = CATALOGUE[name], os.urandom(64)
        if isinstance(entry, Single):
            (folder / entry.file.name).write_bytes(content)
            known = replace(entry.file, sha256=hashlib.sha256(content).hexdigest())
            patch.setitem(CATALOGUE, name, replace(entry, file=known, same=()))
            continue
        for file, *_ in entry.needs:
            (folder / name / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / name / file).write_bytes(content)


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """Makes this machine one that has some weights, and the paper's volumes or none."""

    def has(*names, volumes=False):
        for name in ("data", "weights", "elsewhere"):
            (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path)
        monkeypatch.setenv("TEXGS_DATA", str(tmp_path / "data"))
        monkeypatch.setenv("TEXGS_WEIGHTS", str(tmp_path / "weights"))
        for key in ("TEXGS_CACHE", "TORCH_HOME", "HF_HOME", "HF_HUB_CACHE"):
            monkeypatch.setenv(key, str(tmp_path / "elsewhere"))
        put_weights(tmp_path / "weights", names, monkeypatch)
        if volumes:
            put_volumes(tmp_path / "data")

    return has


def settings(job):
    return yaml.safe_load(Path(job["settings"]).read_text(encoding="utf-8"))


def galleries(plan):
    """The data sets of each gallery, and the edits that they show; with the captions of each."""
    shown, captions = {}, {}
    for job in plan.jobs.values():
        if job["place"] == "gallery":
            own = settings(job)
            name = own["command"].rpartition("=")[2]
            datasets, edits = shown.setdefault(name, (set(), set()))
            datasets.add(own["dataset"])
            scenes = [scene for scene in job["inputs"] if scene != "volume"]
            edits |= {scene.partition("/")[2] for scene in scenes} - {"none"}
            captions.setdefault(name, []).extend(grid["caption"] for grid in own["grids"])
    return shown, captions


def named_by_files(experiments):
    """The data sets and edits, with what these start from, that files of experiments name: the paper's."""
    cases = {name: Case((f"experiment={name}",)) for name in experiments}
    cases = {name: case.but(f"dataset={case.config.datasets[0]}") for name, case in cases.items()}
    edits = {name: {each.config.edit.name for each in edits_of(case)} for name, case in cases.items()}
    return {name: (set(case.config.datasets), edits[name]) for name, case in cases.items()}


@pytest.mark.workflow
def test_figures_have_the_papers_data_sets_and_methods_where_these_are_there(machine):
    machine(*ALL, volumes=True)
    plan, missing = make(words_of({"experiment": "paper"}))
    assert not missing
    shown, captions = galleries(plan)
    swept = {"lambda_s": ({"supernova"}, SHARES)}  # an edit of each variant
    assert shown == named_by_files(shown) | swept
    assert {"paper_image", "paper_text", "pse", "partial", "failures", "lambda_s"} <= set(shown)
    assert not [text for texts in captions.values() for text in texts if "stands in" in text]
    for folder, job in plan.jobs.items():
        own = settings(job)
        if job["place"] == "edit" and re.search("_paper|leaf_beetle", own["edit"]["name"]):
            keys = own["edit"][own["edit"]["method"]]
            assert keys.items() >= RECIPES[own["edit"]["method"]].items(), folder
            assert own["weights"], folder
            assert all(own["weights"].values()), folder
        if job["place"] in ("phase", "edit", "gallery", "mesh"):
            assert own["fit"]["name"] in ("paper", "gaussians", "plenoxels", "stylerf"), folder


@pytest.mark.workflow
def test_figures_name_what_stands_in_where_data_and_weights_are_missing(machine):
    machine()
    plan, missing = make(words_of({"experiment": "paper"}))
    assert not missing
    shown, captions = galleries(plan)
    assert {"pse", "partial", "texture", "flexibility", "failures", "refinement", "five_scenes"} <= set(shown)
    here = {each.dataset.name for each in cases_of(("experiment=paper",), lacking).configs}
    assert set().union(*(datasets for datasets, _ in shown.values())) <= here
    five_jets = "`jets` stands in for `five_jets`, whose data are not on this machine."
    assert any(text.endswith(five_jets) for text in captions["pse"])
    why = "as this machine cannot use the weights of"
    for name, told in (
        ("texture", f"`text_quick` (filters) stands in for `text_paper`, {why} instruct-pix2pix."),
        ("relighting", f"`painted` (patches) stands in for `style_paper`, {why} vgg16 and clip-vit-base"),
    ):
        assert all(told in text for text in captions[name]), name


@pytest.mark.workflow
def test_the_quick_run_takes_what_is_quick_though_all_is_there(machine):
    machine(*ALL, volumes=True)
    shown, captions = galleries(make(words_of({"experiment": "paper_quick"}))[0])
    assert shown["refinement"] == ({"engine"}, {"wood", "wooden_mosaic", "teal_mosaic"})
    assert not [text for texts in captions.values() for text in texts if "this machine" in text]
    assert all("`engine` stands in for `beetle`." in text for text in captions["refinement"])


@pytest.mark.parametrize(
    ("experiment", "there", "expected"),
    [
        ("relighting", ("vgg16",), {"style"}),
        ("relighting", ("vgg16", "clip-vit-base-patch32"), {"style_paper"}),
        ("partial", ("instruct-pix2pix",), {"part", "wooden_part"}),
        (
            "texture",
            ("instruct-pix2pix",),
            {"painted", "painted_untextured", "text_paper", "text_paper_untextured"},
        ),
        ("lambda_s", ("vgg16",), set()),  # one of four variants alone says nothing
        ("lambda_s", ("vgg16", "clip-vit-base-patch32"), SHARES),
        ("relighting edits=[style_paper,text]", (), {"style_paper", "text"}),  # those that are named win
    ],
)
def test_edits_are_the_first_that_lack_no_weights(machine, experiment, there, expected):
    machine(*there)
    name, *words = experiment.split()
    skips = ("on_missing=skip",) if name == "lambda_s" else ()
    cases = cases_of((f"experiment={name}", *skips, *words), lacking)
    assert {edit_folder(each) for each in cases.configs if each.edit.name != "none"} == expected
    assert bool(cases.configs) is bool(expected)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("experiment=pse",), {"engine", "jets"}),
        (("experiment=pse", "dataset=mantle"), {"mantle"}),  # a data set that is named wins
        (("experiment=both",), {"engine", "jets", "flame"}),
        (("experiment=both", "dataset=mantle"), {"mantle"}),
        (("experiment=both", "dataset=engine", "dataset.engine.image=99"), {"engine"}),
        (("experiment=meshes",), {"turbulence", "engine"}),
    ],
)
def test_a_data_set_that_is_named_wins_over_what_stands_in(machine, words, expected):
    machine()
    write("both", "experiments: [pse, five_scenes]\n")
    cases = cases_of(words, lacking)
    assert {each.dataset.name for each in cases.configs} == expected
    assert len({fit_folder(each) for each in cases.configs}) == (2 if "meshes" in words[0] else 1)


def write(name, text):
    """A file of the user's experiments."""
    folder = Path("conf", "experiment")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.yaml").write_text(f"# @package _global_\n{text}", encoding="utf-8")


def test_what_is_replaced_is_told_with_its_reason(machine):
    machine()
    told = {each.what: each.why for each in cases_of(("experiment=relighting",), lacking).left_out}
    assert told.keys() == {"data set supernova", "data set five_jets", "edit style_paper"}
    assert told["data set supernova"].endswith("TEXGS_DATA; `turbulence` stands in for it")
    assert re.search("vgg16 and clip-vit-base-.*`painted` stands in", told["edit style_paper"])


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("datasets: {mantel: engine}", "stand_ins.datasets: expected files of conf/dataset, got mantel, did"),
        ("edits: {style: paintd}", "stand_ins.edits: expected files of conf/edit, got paintd, did you mean"),
    ],
)
def test_a_mistake_is_one_sentence(machine, table, message):
    machine()
    write("mine", f"datasets: [jets]\nstand_ins:\n  {table}\n")
    refused(lambda: cases_of(("experiment=mine",), lacking), message, ConfigError)


def test_where_all_lack_something_it_is_the_first_that_is_told(machine):
    machine()
    write("mine", "datasets: [mantle]\nstand_ins:\n  datasets: {mantle: wood, wood: mantle}\n")
    cases = cases_of(("experiment=mine", "on_missing=skip"), lacking)
    assert not cases.configs
    assert [each.what for each in cases.left_out] == ["data set mantle"]


def test_a_part_is_where_the_data_set_says(machine):
    machine()
    assert compose(("dataset=engine", "edit=wooden_part")).edit.parts == ["TF02/part"]
    words = ("dataset=turbulence", "edits=[part]")
    refused(lambda: cases_of(words, lacking), r"edit.segment.model: expected one of TF01, TF02", ConfigError)
