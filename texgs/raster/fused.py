"""Losses whose library function returns the gradient along with the value."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor

# Inputs and constants, and whether each input's gradient is wanted, to the value [] and those gradients.
Evaluate = Callable[[Sequence[Tensor], Sequence[bool]], tuple[Tensor, Sequence[Tensor | None]]]


def fused_loss(evaluate: Evaluate, inputs: Sequence[Tensor], constants: Sequence[Tensor]) -> Tensor:
    """Value [] of a loss, differentiable once in `inputs`.

    Autograd refuses a second backward pass after one of the tensors was changed.
    """
    wanted = [torch.is_grad_enabled() and x.requires_grad for x in inputs]
    return _FusedLoss.apply(evaluate, wanted, *inputs, *constants)


class _FusedLoss(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, evaluate: Evaluate, wanted: list[bool], *tensors: Tensor) -> Tensor:
        value, ctx.gradients = evaluate(tensors, wanted)
        ctx.evaluate, ctx.wanted = evaluate, wanted
        ctx.save_for_backward(*tensors)
        return value

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, upstream: Tensor) -> tuple[Tensor | None, ...]:
        # Autograd may accumulate into what it is handed: another pass through a retained graph computes anew.
        gradients = ctx.gradients or ctx.evaluate(ctx.saved_tensors, ctx.wanted)[1]
        ctx.gradients = None
        # A weight of 1 is common and scaling a pass over the image; looking at it would make a GPU wait.
        if upstream.device.type != "cpu" or upstream.item() != 1.0:
            gradients = [g if g is None else g.mul_(upstream) for g in gradients]
        constants = len(ctx.needs_input_grad) - 2 - len(gradients)
        return None, None, *gradients, *[None] * constants
