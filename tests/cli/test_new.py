"""`texgs new`: from a volume file to a data set that composes."""

import numpy as np
import pytest
import yaml

from texgs.cli.main import main
from texgs.config import compose as composing
from texgs.config.compose import compose
from texgs.volume.tf_files import write_tf
from texgs.volume.transfer import TransferFunction


@pytest.fixture
def conf(tmp_path, monkeypatch):
    """A configuration folder to write to, and a working directory."""
    import shutil

    shutil.copytree(composing.FOLDER, tmp_path / "conf")
    monkeypatch.setattr(composing, "FOLDER", tmp_path / "conf")
    monkeypatch.chdir(tmp_path)
    compose.cache_clear()
    yield tmp_path / "conf"
    compose.cache_clear()


@pytest.fixture
def scan(tmp_path):
    """Air, and two materials."""
    random = np.random.default_rng(0)
    values = random.normal(20, 5, (24, 20, 16))
    values[6:18, 5:15, 4:12] = random.normal(120, 6, (12, 10, 8))
    values[9:15, 8:12, 6:10] = random.normal(220, 6, (6, 4, 4))
    np.save(tmp_path / "my scan.v2.npy", values.astype(np.float32))
    return tmp_path / "my scan.v2.npy"


def test_a_data_set_with_suggested_tfs(conf, scan, capsys):
    assert main(["new", str(scan), "--name", "my_scan", "up=+z", "spacing=[1,1,2]"]) == 0
    out = capsys.readouterr().out
    assert "snakemake --cores all --config dataset=my_scan" in out
    config = compose(("dataset=my_scan",))
    assert config.dataset.volume.up == "+z"
    assert config.dataset.volume.spacing == [1, 1, 2]
    assert len(config.dataset.basic_tfs) == 2
    first, second = config.dataset.basic_tfs.values()
    assert (
        first.opacity[0][0] < 120 < first.opacity[-1][0] <= second.opacity[0][0] < 220 < second.opacity[-1][0]
    )
    assert (conf.parent / "results" / "my_scan" / "transfer" / "transfer.png").exists()
    text = (conf / "dataset" / "my_scan.yaml").read_text()
    assert yaml.safe_load(text)["volume"]["file"] == str(scan)


def test_tfs_from_files(conf, scan, tmp_path):
    tf = TransferFunction(((100, 0), (120, 0.5), (140, 0)), ((100, 1, 0, 0),))
    write_tf(tmp_path / "tf.json", tf)
    assert main(["new", str(scan), "--name", "mine", "--tf", str(tmp_path / "tf.json")]) == 0
    (read,) = compose(("dataset=mine",)).dataset.basic_tfs.values()
    assert [list(point) for point in read.opacity] == [[100, 0], [120, 0.5], [140, 0]]


def test_a_data_set_is_not_overwritten(conf, scan, capsys):
    assert main(["new", str(scan), "--name", "engine"]) == 2
    assert "is there already; choose another --name" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["no.nrrd"], "no.nrrd"),
        (["{scan}", "rreduce=2"], "dataset.volume.rreduce: no such key"),
        (["{scan}", "--name", "a/b"], "--name: expected a letter"),
        (["{scan}", "dims=[1,2,3]"], "leave them out"),
        (["{scan}", "--count", "0"], "count"),
    ],
)
def test_mistakes_write_nothing(conf, scan, capsys, words, message):
    before = sorted(path.name for path in (conf / "dataset").iterdir())
    assert main(["new", *(word.format(scan=scan) for word in words)]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]
    assert sorted(path.name for path in (conf / "dataset").iterdir()) == before
