import hashlib
import json
import sys
from importlib.util import find_spec

import pytest

from tests.real_data import real_data
from tests.refusals import refused
from texgs.core.cache import Checksums
from texgs.core.errors import ArgumentError, MissingDataError
from texgs.models.catalogue import CATALOGUE, File, Single, Snapshot
from texgs.models.networks import read_tensors
from texgs.models.weights import checksum, find, locate, missing_advice, pipeline_files, title_of

CONTENT = b"weights of a model"
CHECKSUM = hashlib.sha256(CONTENT).hexdigest()
UNREACHABLE = "http://127.0.0.1:9/tiny.bin"  # the port of a service that discards, closed everywhere


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A weights folder of its own, caches that are empty, and two entries in the catalogue."""
    for name, path in (("TEXGS_WEIGHTS", "weights"), ("TEXGS_CACHE", "cache"), ("TORCH_HOME", "torch")):
        monkeypatch.setenv(name, str(tmp_path / path))
    monkeypatch.setenv("HF_HUB_CACHE", str(tmp_path / "hub"))
    if find_spec("huggingface_hub"):
        monkeypatch.setattr("huggingface_hub.constants.HF_HUB_OFFLINE", True)
    tiny, other = (File(name, 0.1, CHECKSUM) for name in ("tiny.bin", "other.bin"))
    monkeypatch.setitem(CATALOGUE, "tiny", Single(tiny, UNREACHABLE, (other,)))
    needs = (("config.json",), ("model.safetensors", "pytorch_model.bin"))
    monkeypatch.setitem(CATALOGUE, "hub", Snapshot("texgs/none", "0" * 40, 1, needs, ("*.json",)))
    return tmp_path


def put(path, content=CONTENT):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("place", ["weights", "cache/weights", "torch/hub/checkpoints"])
@pytest.mark.parametrize("name", ["tiny.bin", "other.bin"])
def test_a_file_is_found_where_it_may_lie_under_either_name(folder, place, name):
    assert not find("tiny")
    path = put(folder / place / name)
    assert locate("tiny") == path
    assert find("tiny")
    first = put(folder / "weights" / name)
    assert locate("tiny") == first, "of several files"


def test_another_file_of_that_name_is_refused_also_after_it_was_whole(folder):
    path = put(folder / "weights" / "tiny.bin")
    assert find("tiny")
    put(path, b"half of")
    for look in (locate, find):
        refused(lambda look=look: look("tiny"), f"tiny.bin: .* checksum {CHECKSUM[:12]}")


def test_missing_weights_are_told_with_size_source_and_place(folder):
    place = f"other.bin or tiny.bin into {folder / 'weights'}"
    refused(lambda: locate("tiny"), rf"tiny: .*0\.1 MB.*{UNREACHABLE}.*{place}", MissingDataError)
    assert not list(folder.rglob("tiny.bin*")), "nothing half downloaded is left"


@pytest.mark.parametrize("place", ["weights/hub", f"hub/models--texgs--none/snapshots/{'0' * 40}"])
def test_a_folder_is_found_once_it_is_complete(folder, place):
    put(folder / place / "config.json")
    assert not find("hub")
    put(folder / place / "pytorch_model.bin")
    assert locate("hub") == folder / place


def test_another_revision_in_the_cache_of_the_hub_is_found_and_named_and_the_pinned_one_comes_first(folder):
    for revision in ("f" * 40, "a" * 40):
        put(folder / "hub" / "models--texgs--none" / "snapshots" / revision / "config.json")
    assert find("hub") is None, "both lack a file"
    assert title_of("hub") == "hub"
    other = put(folder / "hub" / "models--texgs--none" / "snapshots" / ("f" * 40) / "model.safetensors")
    assert locate("hub") == other.parent
    assert title_of("hub") == "hub (revision ffffffffffff, not 000000000000)"
    of_other = checksum("hub", Checksums())
    for name in ("config.json", "model.safetensors"):
        put(folder / "hub" / "models--texgs--none" / "snapshots" / ("0" * 40) / name, b"pinned")
    assert (find("hub").name, title_of("hub")) == ("0" * 40, "hub")
    assert checksum("hub", Checksums()) != of_other
    for name in ("config.json", "model.safetensors"):
        put(folder / "weights" / "hub" / name)
    assert (find("hub"), title_of("hub")) == (folder / "weights" / "hub", "hub"), "the folder is asked first"


def test_weights_without_the_package_that_reads_them_are_of_no_use(folder, monkeypatch):
    assert "`texgs weights hub`" in missing_advice("hub")
    for name in ("config.json", "model.safetensors"):
        put(folder / "weights" / "hub" / name)
    monkeypatch.setitem(sys.modules, "transformers", None)
    assert "pip install '.[models]'" in missing_advice("hub")
    assert checksum("hub", Checksums()) is None
    put(folder / "weights" / "tiny.bin")
    assert missing_advice("tiny") == "", "a file needs none"
    monkeypatch.delitem(sys.modules, "transformers")
    if find_spec("transformers"):
        assert missing_advice("hub") == ""
        assert checksum("hub", Checksums())


@pytest.mark.parametrize(
    ("name", "named", "error"),
    [
        ("hub", "huggingface.co/texgs/none and put the folder hub", MissingDataError),
        ("vgg19", "vgg16, .*'vgg19'", ArgumentError),
        *(
            (name, "OWNER/NAME@REVISI", ArgumentError)
            for name in ("a/editor", "a/editor@main", f"e@{'c' * 40}")
        ),
    ],
)
def test_what_is_not_there_or_unknown_is_named(folder, name, named, error):
    refused(lambda: locate(name), named, error)


def test_without_a_network_the_hub_is_asked_once(folder, monkeypatch):
    constants = pytest.importorskip("huggingface_hub").constants
    monkeypatch.setattr(constants, "HF_HUB_OFFLINE", False)
    monkeypatch.setattr(constants, "ENDPOINT", UNREACHABLE)
    monkeypatch.setattr("time.sleep", lambda seconds: pytest.fail("it tries again"))
    refused(lambda: locate("hub"), "a download failed", MissingDataError)


PINNED = f"someone/editor@{'c' * 40}"


@pytest.fixture(params=[PINNED, f"hub/models--someone--editor/snapshots/{'c' * 40}"])
def pipeline(request, folder):
    """The folder that a pipeline of the hub may be in, of weights or of the hub's cache."""
    return folder / (f"weights/{PINNED}" if request.param == PINNED else request.param)


def test_a_pipeline_is_found_once_it_has_all_that_its_index_names(pipeline):
    index = {"_class_name": "A", "flag": True, "vae": ["diffusers", "B"], "unet": ["diffusers", "C"]}
    index |= {"scheduler": ["diffusers", "D"], "tokenizer": ["transformers", "E"], "safety": [None, None]}
    shards = {"weight_map": {"a": "part-1.safetensors", "b": "part-2.safetensors", "c": "part-1.safetensors"}}
    files = {
        "model_index.json": json.dumps(index),
        "vae/config.json": "{}",
        "vae/diffusion_pytorch_model.safetensors": "1",
        "unet/config.json": "{}",
        "unet/diffusion_pytorch_model.safetensors.index.json": json.dumps(shards),
        "unet/part-1.safetensors": "1",
        "unet/part-2.safetensors": "2",
        "scheduler/scheduler_config.json": "{}",
        "tokenizer/tokenizer_config.json": "{}",
    }
    for name, text in files.items():
        assert find(PINNED) is None, name
        put(pipeline / name, text.encode())
    assert (locate(PINNED), title_of(PINNED)) == (pipeline, PINNED)
    present = {each for names in pipeline_files(pipeline) for each in names if (pipeline / each).is_file()}
    assert present == set(files)
    if not missing_advice(PINNED):
        before = checksum(PINNED, Checksums())
        put(pipeline / "unet/part-2.safetensors", b"3")
        assert checksum(PINNED, Checksums()) != before
    for name, text in (("model_index.json", b"{"), ("model_index.json", b"[]")):
        put(pipeline / name, text)
        assert find(PINNED) is None, "an index that cannot be read"


def test_no_other_revision_stands_in_for_that_of_a_pipeline(folder):
    for name, text in (("model_index.json", b'{"vae": ["a", "b"]}'), ("vae/scheduler_config.json", b"")):
        put(folder / f"hub/models--someone--editor/snapshots/{'c' * 40}" / name, text)
    assert find(PINNED)
    other = PINNED.replace("c" * 40, "d" * 40)
    assert find(other) is None
    refused(lambda: locate(other), f"{other}: .*unknown size", MissingDataError)


def test_the_catalogue_says_what_each_file_is():
    for entry in CATALOGUE.values():
        if isinstance(entry, Single):
            assert all(len(bytes.fromhex(file.sha256)) == 32 and file.megabytes > 0 for file in entry.files)
        else:
            assert len(bytes.fromhex(entry.revision)) == 20
            assert entry.source.endswith(entry.repository)


@pytest.mark.parametrize("name", ["vgg16", "lpips_vgg", "mobile_sam"])
def test_real_weights_are_whole(name, monkeypatch):
    monkeypatch.setenv("TEXGS_WEIGHTS", str(real_data("weights")))
    assert len(read_tensors(locate(name))) > 4
