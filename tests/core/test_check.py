import pytest
import torch

from tests.refusals import refused
from texgs.core import check
from texgs.core.errors import ArgumentError, DeviceError, ShapeError, TexgsError


def test_shape_binds_names_that_must_agree():
    assert check.shape("image", torch.zeros(4, 5, 3), "H W 3") == {"H": 4, "W": 5}
    assert check.shape("scalar", torch.tensor(1.0), "") == {}
    assert check.shape("matrix", torch.eye(3), "N N") == {"N": 3}
    refused(lambda: check.shape("quats", torch.zeros(6, 4), "N 4", N=5), r"quats: .*\[6, 4\]", ShapeError)


@pytest.mark.parametrize(
    ("got", "spec", "message"),
    [
        ((3, 500), "N 3", r"means: expected \[N, 3\], got \[3, 500\]; did you transpose\?"),
        ((5,), "N 1", r"got \[5\]; add the last axis"),
        ((5, 1), "N", r"got \[5, 1\]; drop the last axis"),
        ((1, 4, 4), "4 4", r"got \[1, 4, 4\]; batches are not supported"),
        ((5, 2), "N 3", r"expected \[N, 3\], got \[5, 2\]$"),
        ((), "N", r"expected \[N\], got \[\]$"),
        ((2, 3), "N N", r"expected \[N, N\], got \[2, 3\]"),
    ],
)
def test_shape_message_names_the_likely_mistake(got, spec, message):
    refused(lambda: check.shape("means", torch.zeros(got), spec), message, ShapeError)


def test_constants_must_not_require_a_gradient():
    learned = torch.zeros(3, requires_grad=True)
    check.constant(first=torch.zeros(3), second=None, third=learned.detach())
    refused(lambda: check.constant(first=torch.zeros(3), light=learned), r"light: .*light\.detach\(\)")
    with torch.no_grad():
        check.constant(light=learned)


def test_type_and_device():
    cpu, meta = torch.zeros(1), torch.zeros(1, device="meta")
    check.floating("means", cpu)
    refused(lambda: check.shape("means", [1.0], "N"), "means: .*list")
    refused(lambda: check.floating("means", cpu.double()), r"means: .*float64; .*\.float\(\)")
    assert check.same_device(means=cpu, quats=None) == torch.device("cpu")
    refused(lambda: check.same_device(means=cpu, quats=meta), "quats: .*cpu as means, got meta", DeviceError)


def test_finite_counts_and_locates():
    values = torch.zeros(4, 3)
    check.finite(means=values, quats=None)
    values[2, 1], values[3, 0] = float("nan"), float("-inf")
    refused(lambda: check.finite(means=values), r"means: .* 1 NaN and 1 infinite, .*\[2, 1\]")
    assert issubclass(ArgumentError, TexgsError)
    assert issubclass(ArgumentError, ValueError)
