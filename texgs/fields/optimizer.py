"""Adam over named parameters whose rows come and go."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core import check
from texgs.raster import native

EPSILON = 1e-15
NativeLearned = native.struct("texgs_learned", "n n, p values gradient first second, f keep rate correction")
native.declare("texgs_adam", "n", NativeLearned, "fff")


@dataclass(frozen=True)
class Rate:
    """A learning rate that falls log-linearly over a phase, and what draws a parameter to 0."""

    start: float
    final: float  # relative to the start
    decay: float = 0.0  # share of the parameter that each step takes away, whatever its learning rate

    def at(self, progress: float) -> float:
        """Return the rate at progress 0 to 1."""
        return self.start * self.final**progress


@dataclass
class Moments:
    """Running means of a parameter's gradient and of its square, and the steps that they are of."""

    exp_avg: Tensor
    exp_avg_sq: Tensor
    steps: int = 0

    def map(self, change: Callable[[Tensor], Tensor]) -> "Moments":
        """Return changed ones of as many steps."""
        return Moments(change(self.exp_avg), change(self.exp_avg_sq), self.steps)


class Optimizer:
    """Parameters by name, each with its own learning rate and decay.

    Parameters become leaves that require a gradient; those without a rate are constant. Adam as Kingma and Ba
    2015 have it, decay decoupled from it as by Loshchilov and Hutter 2019; one call of the library a step.
    """

    def __init__(
        self,
        parameters: Mapping[str, Tensor],
        rates: Mapping[str, Rate],
        betas: tuple[float, float] = (0.9, 0.999),
    ) -> None:
        self._rates, self._betas = dict(rates), betas
        self._table = (NativeLearned * len(rates))()
        self._rows = list(self._table)
        for name in rates:
            check.floating(name, parameters[name])
        self.parameters = {name: _leaf(x, name in rates) for name, x in parameters.items()}
        self._moments = {
            name: Moments(torch.zeros_like(self.parameters[name]), torch.zeros_like(self.parameters[name]))
            for name in rates
        }

    def step(self, progress: float) -> None:
        """Take one step with the rates of now, and forget the gradients."""
        beta1, beta2 = self._betas
        learning = {
            name: x.grad
            for name in self._rates
            if (x := self.parameters[name]).grad is not None and x.numel()
        }
        if not learning:
            return
        for row, (name, gradient) in zip(self._rows, learning.items(), strict=False):
            x, rate, moments = self.parameters[name], self._rates[name], self._moments[name]
            moments.steps += 1
            row.n = x.numel()
            row.values, row.gradient = x.data_ptr(), gradient.data_ptr()
            row.first, row.second = moments.exp_avg.data_ptr(), moments.exp_avg_sq.data_ptr()
            row.keep = 1 - rate.decay
            row.rate = rate.at(progress) / (1 - beta1**moments.steps)
            row.correction = (1 - beta2**moments.steps) ** -0.5
            x.grad = None
        shares = (1 - beta1, 1 - beta2)
        native.call("texgs_adam", len(learning), self._table, *shares, EPSILON, device=x.device)
        torch.autograd.graph.increment_version([self.parameters[name] for name in learning])

    def edit_rows(self, n: int, keep: Tensor, added: Mapping[str, Tensor]) -> None:
        """Keep some [n] bool of the n rows and append others by name, whose moments start at zero.

        Parameters of another length are shared and stay.
        """

        def edited(moment: Tensor) -> Tensor:
            return torch.cat([moment[keep], moment.new_zeros(count, *moment.shape[1:])])

        for name, old in self.parameters.items():
            if len(old) == n and name in added:
                count = len(added[name])
                self._replace(name, torch.cat([old.detach()[keep], added[name]]), edited)

    def reset(self, name: str, values: Tensor) -> None:
        """Give a parameter new values and zero moments."""
        self._replace(name, values, torch.zeros_like)

    def _replace(self, name: str, values: Tensor, moment: Callable[[Tensor], Tensor]) -> None:
        self.parameters[name] = _leaf(values, name in self._rates)
        if name in self._rates:
            self._moments[name] = self._moments[name].map(moment)

    def state(self) -> dict[str, Tensor]:
        """Return all parameters and moments, for a checkpoint."""
        state = {name: x.detach() for name, x in self.parameters.items()}
        for name, moments in self._moments.items():
            values = {"exp_avg": moments.exp_avg, "exp_avg_sq": moments.exp_avg_sq}
            values["step"] = torch.tensor(float(moments.steps))
            state |= {f"adam.{name}.{key}": value for key, value in values.items()}
        return state

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Go on from `state`, wherever it was kept."""
        for name, old in self.parameters.items():
            self.parameters[name] = _leaf(state[name].to(old.device), name in self._rates)
        for name in self._rates:
            x, prefix = self.parameters[name], f"adam.{name}."
            means = (state[prefix + key].to(x.device, copy=True) for key in ("exp_avg", "exp_avg_sq"))
            self._moments[name] = Moments(*means, int(state[prefix + "step"]))


def _leaf(values: Tensor, learns: bool) -> Tensor:
    """Return a dense copy of values that is a leaf of autograd."""
    return values.detach().clone(memory_format=torch.contiguous_format).requires_grad_(learns)
