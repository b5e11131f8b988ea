"""Adam over named parameters with rows that are added and removed."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core import check
from texgs.raster import native

EPSILON = 1e-15
Learned = native.struct("texgs_learned", "n n, p values gradient moments, f keep rate correction")
native.declare("texgs_adam", "n", Learned, "fff")


@dataclass(frozen=True)
class Rate:
    """A learning rate that falls log-linearly over a phase, and a decay of the parameter."""

    start: float
    final: float  # relative to the start
    decay: float = 0.0  # share of the parameter that each step removes, independent of the rate

    def at(self, progress: float) -> float:
        """Return the rate at progress 0 to 1."""
        return self.start * self.final**progress


class Optimizer:
    """Parameters by name, each with its own learning rate and decay; a step is one call of the library.

    Parameters become leaves that require a gradient; those without a rate are constant.
    """

    def __init__(
        self,
        parameters: Mapping[str, Tensor],
        rates: Mapping[str, Rate],
        betas: tuple[float, float] = (0.9, 0.999),
    ) -> None:
        self._rates, self._betas = dict(rates), betas
        self.parameters, self._moments = dict(parameters), {}
        self._steps = dict.fromkeys(rates, 0)
        self._table = (Learned * len(rates))()
        for name, x in parameters.items():
            if name in rates:
                check.floating(name, x)
                self._moments[name] = torch.zeros(2, *x.shape, device=x.device)  # of gradients and squares
            self._replace(name, x)

    def step(self, progress: float) -> None:
        """Take one step with the current rates, and clear the gradients."""
        gradients = ((name, self.parameters[name].grad) for name in self._rates)
        moving = {name: gradient for name, gradient in gradients if gradient is not None}
        beta1, beta2 = self._betas
        for (name, gradient), row in zip(moving.items(), self._table, strict=False):
            x, rate = self.parameters[name], self._rates[name]
            steps = self._steps[name] = self._steps[name] + 1
            row.n, row.values, row.gradient = x.numel(), x.data_ptr(), gradient.data_ptr()
            row.moments, row.keep = self._moments[name].data_ptr(), 1 - rate.decay
            row.rate, row.correction = rate.at(progress) / (1 - beta1**steps), (1 - beta2**steps) ** -0.5
        if moving:
            native.call(
                "texgs_adam", len(moving), self._table, 1 - beta1, 1 - beta2, EPSILON, device=x.device
            )
            torch.autograd.graph.increment_version([self.parameters[name] for name in moving])
        for x in self.parameters.values():
            x.grad = None

    def edit_rows(self, n: int, keep: Tensor, added: Mapping[str, Tensor]) -> None:
        """Keep some [n] bool of the n rows and append others by name, whose moments start at zero.

        Parameters of another length are shared and stay unchanged.
        """

        def edited(moments: Tensor) -> Tensor:
            return torch.cat([moments[:, keep], moments.new_zeros(2, count, *moments.shape[2:])], dim=1)

        for name, old in self.parameters.items():
            if len(old) == n and name in added:
                count = len(added[name])
                self._replace(name, torch.cat([old.detach()[keep], added[name]]), edited)

    def reset(self, name: str, values: Tensor) -> None:
        """Replace the values of a parameter, and reset its moments."""
        self._replace(name, values, torch.zeros_like)

    def _replace(self, name: str, values: Tensor, moments: Callable[[Tensor], Tensor] = torch.clone) -> None:
        dense = values.detach().clone(memory_format=torch.contiguous_format)
        self.parameters[name] = dense.requires_grad_(name in self._rates)
        if name in self._rates:
            self._moments[name] = moments(self._moments[name])

    def state(self) -> dict[str, Tensor]:
        """Return all parameters and moments, for a checkpoint."""
        state = {name: x.detach() for name, x in self.parameters.items()}
        for name, steps in self._steps.items():
            state |= {f"adam.{name}.moments": self._moments[name], f"adam.{name}.steps": torch.tensor(steps)}
        return state

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Continue from a `state`, on any device."""
        for name, old in self.parameters.items():
            self._replace(name, state[name].to(old.device))
        for name in self._rates:
            self._moments[name] = state[f"adam.{name}.moments"].to(self.parameters[name].device, copy=True)
            self._steps[name] = int(state[f"adam.{name}.steps"])
