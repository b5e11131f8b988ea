"""Adam over named parameters whose rows come and go."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

MOMENTS = ("exp_avg", "exp_avg_sq")


@dataclass(frozen=True)
class Rate:
    """A learning rate that falls log-linearly over a phase."""

    start: float
    final: float  # relative to the start

    def at(self, progress: float) -> float:
        """Return the rate at progress 0 to 1."""
        return self.start * self.final**progress


class Optimizer:
    """Parameters by name, each with its own learning rate.

    Parameters become leaves that require a gradient; those without a rate are constant.
    """

    def __init__(
        self,
        parameters: Mapping[str, Tensor],
        rates: Mapping[str, Rate],
        betas: tuple[float, float] = (0.9, 0.999),
    ) -> None:
        self._rates = dict(rates)
        self.parameters = {
            name: x.detach().clone().requires_grad_(name in rates) for name, x in parameters.items()
        }
        groups = [{"params": [self.parameters[name]], "name": name, "lr": 0.0} for name in self._rates]
        self._adam = torch.optim.Adam(groups, betas=betas, eps=1e-15, fused=True)

    def step(self, progress: float) -> None:
        """Take one step with the rates of now, and forget the gradients."""
        for group in self._adam.param_groups:
            group["lr"] = self._rates[group["name"]].at(progress)
        self._adam.step()
        self._adam.zero_grad(set_to_none=True)

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
        old = self.parameters[name]
        leaf = self.parameters[name] = values.detach().clone().requires_grad_(old.requires_grad)
        for group in self._adam.param_groups:
            if group["name"] == name:
                group["params"] = [leaf]
                if state := self._adam.state.pop(old, {}):
                    self._adam.state[leaf] = {
                        key: moment(value) if key in MOMENTS else value for key, value in state.items()
                    }

    def state(self) -> dict[str, Tensor]:
        """Return all parameters and moments, for a checkpoint."""
        state = {name: x.detach() for name, x in self.parameters.items()}
        for group in self._adam.param_groups:
            for key, value in self._adam.state.get(group["params"][0], {}).items():
                state[f"adam.{group['name']}.{key}"] = value
        return state

    def restore(self, state: Mapping[str, Tensor]) -> None:
        """Go on from `state`, wherever it was kept."""
        self._adam.state.clear()
        for name, old in self.parameters.items():
            self._replace(name, state[name].to(old.device), torch.zeros_like)
        for group in self._adam.param_groups:
            leaf, prefix = group["params"][0], f"adam.{group['name']}."
            moments = {
                key.removeprefix(prefix): value.to(leaf.device, copy=True)
                for key, value in state.items()
                if key.startswith(prefix)
            }
            if moments:
                self._adam.state[leaf] = moments
