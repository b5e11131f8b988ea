"""Every data set that texgs has: its transfer functions, where it comes from, and the paper's numbers.

A user's own data sets are in conf/dataset too, and need not follow the rules for these.
"""

import json
import re

import pytest
import yaml

from tests.real_data import real_data
from tests.refusals import refused
from tests.report.written import lines
from tests.shipped import DATASETS, ROOT, tracked
from texgs.config.compose import compose
from texgs.core.errors import ConfigError
from texgs.volume.basic_tfs import function_of, in_data_values
from texgs.volume.label_masks import label_counts
from texgs.volume.sources import open_source
from texgs.workflow.checks import check_basic_tfs
from texgs.workflow.locate import source_file, tf_names, views_folder

PAPER = {line["dataset"]: line for line in lines("datasets")}
PROMPTS = {"beetle": 1, "ionization": 1, "chameleon": 2, "engine": 2}  # of its text-driven comparison
# Downloads come from one commit of a repository: what is there never changes.
PINNED = re.compile(r"https://raw\.githubusercontent\.com/[\w.-]+/[\w.-]+/[0-9a-f]{40}/[\w./-]+")
CHECKSUM = re.compile(r"[0-9a-f]{64}")


def dataset(name):
    return compose((f"dataset={name}",)).dataset


def dims_of(name):
    """Samples along x, y and z by the paper."""
    return tuple(int(PAPER[name][f"volume_{axis}"]) for axis in "xyz")


def as_written(name):
    """What its file says: enough to choose data sets when tests are collected."""
    return yaml.safe_load((ROOT / "conf" / "dataset" / f"{name}.yaml").read_text(encoding="utf-8"))


def with_key(key):
    return [name for name in DATASETS if as_written(name).get("volume", {}).get(key) is not None]


def with_values(kind):
    """Data sets whose transfer functions are in values of this kind."""
    return [name for name in DATASETS if as_written(name).get("tf_values", "data") == kind]


@pytest.fixture
def manifest():
    """What is known of the real volumes, by file name."""
    return {entry["file"]: entry for entry in json.loads(real_data("volumes/manifest.json").read_text())}


@pytest.mark.parametrize("name", DATASETS)
def test_is_named_like_its_file_and_says_who_made_it_and_has_one_source(name):
    of = dataset(name)
    assert (of.name, bool(of.title), bool(of.source)) == (name, True, True)
    assert [of.volume.generator, of.volume.file, of.views_folder].count(None) == 2
    check_basic_tfs(of)
    assert bool(of.basic_tfs) == (of.views_folder is None)


@pytest.mark.parametrize("name", with_values("fraction"))
def test_fractions_of_a_range_map_to_data_values(name):
    for points in dataset(name).basic_tfs.values():
        tf = function_of(points, dataset(name).prepared)
        first, last = in_data_values(tf, "fraction", -2.0, 3.0).support
        assert -2.0 <= first < last <= 3.0


@pytest.mark.parametrize("name", with_key("url"))
def test_downloads_are_pinned(name):
    volume = dataset(name).volume
    assert PINNED.fullmatch(volume.url)
    assert CHECKSUM.fullmatch(volume.sha256)


@pytest.mark.parametrize("name", sorted({*with_key("file")} - {*with_key("url")}))
def test_a_file_that_is_neither_there_nor_downloaded_is_explained(name, tmp_path):
    config = compose((f"dataset={name}", f"data_folder={tmp_path}"))
    assert dataset(name).volume.sha256 is None
    refused(lambda: source_file(config), re.escape(dataset(name).volume.obtain), ConfigError)
    assert len(dataset(name).volume.obtain) > 40


@pytest.mark.parametrize("name", PAPER)
def test_has_the_numbers_of_the_paper(name):
    config, dims = dataset(name), dims_of(name)
    assert config.title == name.replace("_", " ")
    assert config.image == PAPER[name]["image_px"]
    assert config.volume.reduce == 1
    if config.views_folder is None:
        assert len(config.basic_tfs) == PAPER[name]["basic_scenes"]
    if config.volume.generator is not None:
        assert (config.volume.size,) * 3 == dims
    if config.volume.dims is not None:
        assert tuple(config.volume.dims) == dims
    if config.volume.dtype is not None:
        assert config.volume.file.endswith(f"_{'x'.join(map(str, dims))}_{config.volume.dtype}.raw")


def test_stand_ins_are_labelled():
    titles = {name.replace("_", " ") for name in PAPER}
    stand_ins = {name: dataset(name).stand_in for name in DATASETS if dataset(name).stand_in}
    assert stand_ins == {"flame": "combustion", "jets": "five jets", "turbulence": "vortex"}
    assert set(stand_ins.values()) <= titles
    assert not set(stand_ins) & set(PAPER)


@pytest.mark.parametrize("name", sorted({*with_key("file")} & {*with_values("data")}))
def test_agrees_with_the_real_volume(name, manifest):
    config = dataset(name)
    known = manifest[config.volume.file]
    source = open_source(real_data(f"volumes/{config.volume.file}"))
    assert list(source.dims) == known["dims_xyz"]
    assert config.volume.sha256 in (None, known["sha256"])
    if name in PAPER:
        assert source.dims == dims_of(name)
    low, high = (0, 255) if config.volume.kind == "labels" else (known["min"], known["max"])
    for points in config.basic_tfs.values():
        tf = function_of(points, config.prepared)
        first, last = in_data_values(tf, "data", low, high).support
        assert low <= first < last <= high


def test_labels_of_the_frog_are_those_of_the_file():
    """All of them but stray samples."""
    volume, labels = dataset("frog").volume, dataset("frog").labels
    counts = label_counts(open_source(real_data(f"volumes/{volume.file}")))
    numbers = [volume.label_numbers[label] for label in labels]
    assert numbers == list(range(1, 16))
    assert sum(counts[number] for number in numbers) > 0.999 * sum(counts.values())


def test_the_published_views_are_found():
    folder = real_data("vortex")
    config = compose(("dataset=vortex", f"data_folder={folder.parent}"))
    assert tf_names(config)[0] == "TF01"
    assert views_folder(config, "TF01") == folder / "TF01"


def test_no_file_is_left_out_and_none_of_the_user_need_follow_these_rules(tmp_path, monkeypatch):
    """`texgs new` writes neither `source` nor `url`; the lists above must not see it."""
    assert set(PAPER) <= set(DATASETS)
    assert tracked("conf/dataset") == sorted(f"{name}.yaml" for name in DATASETS)
    (tmp_path / "conf" / "dataset").mkdir(parents=True)
    (tmp_path / "conf" / "dataset" / "scan.yaml").write_text("name: scan\nvolume: {file: scan.nrrd}\n")
    monkeypatch.chdir(tmp_path)
    assert dataset("scan").source == ""
    assert "scan" not in with_key("file")


def test_scenes_of_one_prompt_in_the_papers_figure_have_one_instruction():
    instructions = {name: {look.instruction for look in dataset(name).looks.values()} for name in PROMPTS}
    assert {name: len(some) for name, some in instructions.items()} == PROMPTS
