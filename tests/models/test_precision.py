import pytest
import torch

from texgs.models import precision


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
    monkeypatch.setattr(precision, "CPUINFO", tmp_path / "cpuinfo")
    precision.has_bfloat16.cache_clear()
    assert precision.fast_dtype("cpu") == expected
    assert precision.fast_dtype(torch.device("cuda")) == torch.float16
    monkeypatch.setattr(precision, "CPUINFO", tmp_path / "none")
    precision.has_bfloat16.cache_clear()
    assert precision.fast_dtype("cpu") == torch.float32
    precision.has_bfloat16.cache_clear()
