"""Checks at public borders, reported by argument name: shapes, dtypes, devices, gradients, finite values."""

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError, DeviceError, ShapeError


def shape(name: str, tensor: Tensor, spec: str, **known: int) -> dict[str, int]:
    """Compare a tensor's shape with a spec such as ``"N 3"`` and return the sizes of its named axes.

    Args:
        name: argument name for the message.
        tensor: tensor to check.
        spec: one token per axis: an integer must be equal; a name binds, and must be equal where it
            occurs twice or is in `known`. An empty spec is a scalar.
        known: sizes of names that are bound already.

    Example:
        >>> shape("means", torch.zeros(5, 3), "N 3")
        {'N': 5}
    """
    if not isinstance(tensor, Tensor):
        raise ArgumentError(f"{name}: expected a torch.Tensor, got {type(tensor).__name__}")
    sizes = bind(tensor.shape, spec, known)
    if sizes is None:
        expected = ", ".join(str(known.get(token, token)) for token in spec.split())
        hint = _hint(tuple(tensor.shape), spec, known)
        raise ShapeError(f"{name}: expected [{expected}], got {list(tensor.shape)}{hint}")
    return sizes


def bind(actual: tuple[int, ...], spec: str, known: dict[str, int]) -> dict[str, int] | None:
    """Return the sizes of the names in `spec` for a shape, or None if it does not fit."""
    tokens = spec.split()
    if len(tokens) != len(actual):
        return None
    sizes: dict[str, int] = {}
    for token, size in zip(tokens, actual, strict=True):
        expected = int(token) if token.isdigit() else {**known, **sizes}.get(token, size)
        if size != expected:
            return None
        if not token.isdigit():
            sizes[token] = size
    return sizes


def _hint(actual: tuple[int, ...], spec: str, known: dict[str, int]) -> str:
    """Return the likely mistake: a transpose, or a missing or superfluous axis."""
    remedies = (
        (len(actual) == 2, actual[::-1], "did you transpose?"),
        (len(actual) > 0, (*actual, 1), "add the last axis with unsqueeze(-1)"),
        (actual[-1:] == (1,), actual[:-1], "drop the last axis with squeeze(-1)"),
        (actual[:1] == (1,), actual[1:], "batches are not supported, pass one element"),
    )
    hints = (hint for applies, other, hint in remedies if applies and bind(other, spec, known) is not None)
    return "".join(f"; {hint}" for hint in [*hints][:1])


def floating(name: str, tensor: Tensor) -> None:
    """Require float32."""
    if tensor.dtype != torch.float32:
        dtype = str(tensor.dtype).removeprefix("torch.")
        raise ArgumentError(f"{name}: expected float32, got {dtype}; convert it with .float()")


def same_device(**tensors: Tensor | None) -> torch.device:
    """Require that all tensors (None is skipped) are on one device, and return it."""
    present = {name: tensor for name, tensor in tensors.items() if tensor is not None}
    if not present:
        raise ArgumentError("same_device: expected at least one tensor, got none")
    first, device = next((name, tensor.device) for name, tensor in present.items())
    for name, tensor in present.items():
        if tensor.device != device:
            raise DeviceError(
                f"{name}: expected device {device} as {first}, got {tensor.device}; move it there"
            )
    return device


def finite(**tensors: Tensor | None) -> None:
    """Require that no tensor (None is skipped) holds NaN or infinity. Waits for the device."""
    for name, tensor in tensors.items():
        if tensor is None or bool(torch.isfinite(tensor).all()):
            continue
        bad = (~torch.isfinite(tensor)).nonzero()  # [n_bad, ndim]
        n_nan = int(torch.isnan(tensor).sum())
        raise ArgumentError(
            f"{name}: expected finite values, got {n_nan} NaN and {len(bad) - n_nan} infinite, "
            f"the first at index {bad[0].tolist()}"
        )


def constant(**tensors: Tensor | None) -> None:
    """Refuse tensors (None is skipped) that require a gradient that is not computed."""
    for name, tensor in tensors.items():
        if tensor is not None and tensor.requires_grad and torch.is_grad_enabled():
            raise ArgumentError(
                f"{name}: not differentiable here, but it requires a gradient; pass {name}.detach()"
            )


def torch_device(name: str) -> torch.device:
    """Return a torch device by name; refuse unknown ones, and a GPU that torch cannot see."""
    if name not in ("cpu", "cuda"):
        raise DeviceError(f"device: expected cpu or cuda, got {name}")
    if name == "cuda" and not torch.cuda.is_available():
        raise DeviceError("device=cuda: torch sees no GPU; leave it out to work on the CPU, see texgs doctor")
    return torch.device(name)
