import pytest
import torch

from texgs.core import check
from texgs.core.errors import ArgumentError, DeviceError, ShapeError, TexgsError


def test_shape_binds_names_that_must_agree():
    assert check.shape("image", torch.zeros(4, 5, 3), "H W 3") == {"H": 4, "W": 5}
    assert check.shape("scalar", torch.tensor(1.0), "") == {}
    assert check.shape("matrix", torch.eye(3), "N N") == {"N": 3}
    with pytest.raises(ShapeError, match=r"quats: expected \[5, 4\], got \[6, 4\]"):
        check.shape("quats", torch.zeros(6, 4), "N 4", N=5)


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
    with pytest.raises(ShapeError, match=message):
        check.shape("means", torch.zeros(got), spec)


def test_constants_must_not_require_a_gradient():
    learned = torch.zeros(3, requires_grad=True)
    check.constant(first=torch.zeros(3), second=None, third=learned.detach())
    with pytest.raises(ArgumentError, match=r"light: not differentiable here.*pass light\.detach\(\)"):
        check.constant(first=torch.zeros(3), light=learned)
    with torch.no_grad():
        check.constant(light=learned)


def test_type_and_device():
    with pytest.raises(ArgumentError, match=r"means: expected a torch\.Tensor, got list"):
        check.shape("means", [1.0], "N")
    check.floating("means", torch.zeros(1))
    message = r"means: expected float32, got float64; convert it with \.float\(\)"
    with pytest.raises(ArgumentError, match=message):
        check.floating("means", torch.zeros(1, dtype=torch.float64))
    cpu, meta = torch.zeros(1), torch.zeros(1, device="meta")
    assert check.same_device(means=cpu, quats=None) == torch.device("cpu")
    with pytest.raises(DeviceError, match=r"quats: expected device cpu as means, got meta"):
        check.same_device(means=cpu, quats=meta)


def test_finite_counts_and_locates():
    values = torch.zeros(4, 3)
    check.finite(means=values, quats=None)
    values[2, 1], values[3, 0] = float("nan"), float("-inf")
    message = r"means: .* got 1 NaN and 1 infinite, the first at index \[2, 1\]"
    with pytest.raises(ArgumentError, match=message) as caught:
        check.finite(means=values)
    assert isinstance(caught.value, TexgsError)
    assert isinstance(caught.value, ValueError)
