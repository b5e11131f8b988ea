from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from tests.refusals import refused
from texgs.models import networks
from texgs.models.networks import read_tensors


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("processor : 0\nflags\t\t: fpu avx512f avx512_bf16 amx_tile\n", torch.bfloat16),
        ("Features : asimd sve bf16\n", torch.bfloat16),
        ("flags : fpu avx2 avx512f\nbugs : bf16\n", torch.float32),
        ("", torch.float32),
    ],
)
def test_the_format_is_what_the_processor_says(tmp_path, monkeypatch, text, expected):
    (tmp_path / "cpuinfo").write_text(text)
    monkeypatch.setattr(networks, "CPUINFO", tmp_path / "cpuinfo")
    networks.has_bfloat16.cache_clear()
    assert networks.fast_dtype("cpu") == expected
    assert networks.fast_dtype(torch.device("cuda")) == torch.float16
    monkeypatch.setattr(networks, "CPUINFO", tmp_path / "none")
    networks.has_bfloat16.cache_clear()
    assert networks.fast_dtype("cpu") == torch.float32
    networks.has_bfloat16.cache_clear()


def test_only_the_tensors_asked_for_come_back(tmp_path):
    tensors = {"a": torch.arange(3.0), "b": torch.ones(2, 2)}
    save_file(tensors, tmp_path / "x.safetensors")
    torch.save(tensors, tmp_path / "x.pth")
    torch.save(tensors, tmp_path / "old.pth", _use_new_zipfile_serialization=False)
    for name in ("x.safetensors", "x.pth", "old.pth"):
        assert read_tensors(tmp_path / name).keys() == tensors.keys()
        read = read_tensors(tmp_path / name, ["b"])
        assert list(read) == ["b"]
        assert torch.equal(read["b"], tensors["b"])
        refused(lambda name=name: read_tensors(tmp_path / name, ["b", "c"]), f"{name}: .* tensor c")


class Harmful:
    def __reduce__(self):
        return (Path.touch, (Path("harm"),))


def test_a_damaged_file_and_one_that_holds_code_are_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    torch.save({"a": torch.ones(1000), "b": Harmful()}, tmp_path / "code.pth")
    torch.save({"a": torch.ones(1000)}, tmp_path / "x.pth")
    save_file({"a": torch.ones(1000)}, tmp_path / "x.safetensors")
    bad = [tmp_path / "code.pth"]
    for path in (tmp_path / "x.pth", tmp_path / "x.safetensors"):
        whole = path.read_bytes()
        for kind, content in (
            ("cut", whole[: len(whole) // 2]),
            ("text", b"<html>not found</html>"),
            ("empty", b""),
        ):
            bad.append(path.with_stem(kind))
            bad[-1].write_bytes(content)
    for path in bad:
        refused(lambda path=path: read_tensors(path), f"{path}: expected a file of weights")
    assert not Path("harm").exists()
    refused(lambda: read_tensors(tmp_path / "gone.pth"), r"gone\.pth: no such file")
