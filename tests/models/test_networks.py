import pytest
import torch

from texgs.models import networks


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
