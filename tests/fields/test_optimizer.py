import pytest
import torch

from tests.devices import device  # noqa: F401, a fixture
from tests.raster.requirements import require_equal, require_same_bits
from tests.refusals import refused
from texgs.fields.optimizer import Optimizer, Rate


def parameters(n=6, seed=0):
    generator = torch.Generator().manual_seed(seed)
    rows = {"means": torch.randn(n, 3, generator=generator), "opacities": torch.randn(n, generator=generator)}
    return {**rows, "ambient": torch.randn(1, generator=generator), "still": torch.ones(n)}


RATES = {"means": Rate(0.1, 0.5), "opacities": Rate(0.02, 0.01), "ambient": Rate(0.3, 1.0)}


def gradient(name, x, step):
    """Some function of place and time, row by row, so that it does not depend on the other rows."""
    return torch.sin(3 * x + step + len(name))


def descend(optimizer, steps):
    for step in steps:
        for name in RATES:
            optimizer.parameters[name].grad = gradient(name, optimizer.parameters[name].detach(), step)
        optimizer.step(step / 10)


def oracle(steps, values, rates=RATES, betas=(0.9, 0.999)):
    """Parameters after steps of torch.optim.AdamW, in float64: its decay is a share of the rate."""
    leaves = {name: values[name].double().requires_grad_() for name in rates}
    adam = torch.optim.AdamW([{"params": [x]} for x in leaves.values()], betas=betas, eps=1e-15)
    for step in steps:
        for group, (name, x) in zip(adam.param_groups, leaves.items(), strict=True):
            group["lr"] = rates[name].start * rates[name].final ** (step / 10)
            group["weight_decay"] = rates[name].decay / group["lr"]
            x.grad = gradient(name, x.detach(), step)
        adam.step()
    return leaves


def assert_close(optimizer, expected, rows=slice(None)):
    for name, x in expected.items():
        rows_of = x.detach() if name == "ambient" else x.detach()[rows]
        value = optimizer.parameters[name].detach()[: len(rows_of)].double()
        torch.testing.assert_close(value, rows_of, rtol=1e-5, atol=1e-6)


DECAYING = {**RATES, "means": Rate(0.1, 0.5, decay=0.05), "ambient": Rate(0.3, 1.0, decay=1.0)}


@pytest.mark.parametrize("rates", [RATES, DECAYING], ids=["plain", "decaying"])
def test_it_is_adam_on_every_device(rates, device):  # noqa: F811
    """Of more floats than threads work on in one piece, and rows that fill no vector."""
    given = {name: x.to(device) for name, x in parameters(n=7001).items()}
    optimizer = Optimizer(given, rates, betas=(0.8, 0.95))
    descend(optimizer, range(6))
    for name, x in oracle(range(6), parameters(n=7001), rates, (0.8, 0.95)).items():
        value = optimizer.parameters[name].detach().double().cpu()
        torch.testing.assert_close(value, x.detach(), rtol=1e-5, atol=2e-6)


def test_more_parameters_than_one_launch_takes(device):  # noqa: F811
    values = {str(i): torch.randn(i, generator=torch.Generator().manual_seed(i)) for i in range(40)}
    rates = {name: Rate(0.01 * (1 + int(name)), 0.5) for name in values}
    optimizer = Optimizer({name: x.to(device) for name, x in values.items()}, rates)
    for name, x in optimizer.parameters.items():
        x.grad = gradient(name, x.detach(), 0)
    optimizer.step(0.0)
    for name, x in oracle([0], values, rates).items():
        torch.testing.assert_close(optimizer.parameters[name].detach().cpu().double(), x.detach())


def test_any_number_of_threads_gives_the_same_bits():
    def fitted():
        optimizer = Optimizer(parameters(n=30_001), DECAYING)
        descend(optimizer, range(2))
        return optimizer.state()

    require_same_bits(fitted)


def test_a_decay_is_a_share_of_the_parameter_whatever_its_rate():
    optimizer = Optimizer({"means": torch.full((3,), 2.0)}, {"means": Rate(0.0, 1.0, decay=0.25)})
    for _ in range(2):
        optimizer.parameters["means"].grad = torch.ones(3)
        optimizer.step(0.0)
    assert torch.equal(optimizer.parameters["means"].detach(), torch.full((3,), 2 * 0.75**2))


def test_a_parameter_without_a_gradient_takes_no_step():
    optimizer = Optimizer(parameters(), DECAYING)
    optimizer.step(0.0)
    optimizer.parameters["ambient"].grad = torch.ones(1)
    optimizer.step(0.0)
    assert torch.equal(optimizer.parameters["means"].detach(), parameters()["means"])
    steps = {name: int(optimizer.state()[f"adam.{name}.steps"]) for name in RATES}
    assert steps == {"means": 0, "opacities": 0, "ambient": 1}


def test_autograd_sees_that_parameters_change():
    optimizer = Optimizer(parameters(), RATES)
    value = optimizer.parameters["means"].square().sum()
    optimizer.parameters["means"].grad = torch.ones(6, 3)
    optimizer.step(0.0)
    refused(value.backward, "modified by an inplace operation", RuntimeError)


def test_parameters_without_a_rate_are_constant_and_given_ones_stay_untouched():
    given = parameters()
    optimizer = Optimizer(given, RATES)
    descend(optimizer, range(3))
    assert not optimizer.parameters["still"].requires_grad
    assert torch.equal(optimizer.parameters["still"], torch.ones(6))
    require_equal(given, parameters())


def test_rows_that_stay_keep_their_moments_and_new_ones_have_none():
    keep = torch.tensor([True, False, True, True, False, True])
    optimizer = Optimizer(parameters(), RATES)
    descend(optimizer, range(4))
    added = {name: x[:2] for name, x in parameters(seed=5).items() if name != "ambient"}
    optimizer.edit_rows(6, keep, added)
    assert {name: len(x) for name, x in optimizer.parameters.items()} == {
        "means": 6, "opacities": 6, "ambient": 1, "still": 6,
    }  # fmt: skip
    for name in ("means", "opacities", "still"):
        assert torch.equal(optimizer.parameters[name][4:], added[name])
    state = optimizer.state()
    assert torch.equal(state["adam.means.moments"][:, 4:], torch.zeros(2, 2, 3))
    assert (state["adam.means.moments"][:, :4] != 0).all()
    descend(optimizer, range(4, 9))
    assert_close(optimizer, oracle(range(9), parameters()), keep)


def test_all_rows_may_go():
    optimizer = Optimizer(parameters(), RATES)
    descend(optimizer, range(2))
    none = {name: x[:0] for name, x in parameters().items() if name != "ambient"}
    optimizer.edit_rows(6, torch.zeros(6, dtype=torch.bool), none)
    descend(optimizer, range(2, 4))
    assert optimizer.parameters["means"].shape == (0, 3)


def test_a_reset_gives_values_and_forgets_moments():
    optimizer = Optimizer(parameters(), RATES)
    descend(optimizer, range(4))
    before = optimizer.state()
    optimizer.reset("opacities", torch.full((6,), -2.0))
    state = optimizer.state()
    assert torch.equal(state["opacities"], torch.full((6,), -2.0))
    assert not state["adam.opacities.moments"].any()
    assert torch.equal(state["adam.means.moments"], before["adam.means.moments"])
    assert optimizer.parameters["opacities"].requires_grad


@pytest.mark.parametrize("steps", [0, 3])
def test_a_restored_one_goes_on_bit_for_bit(steps):
    first, second = Optimizer(parameters(), RATES), Optimizer(parameters(seed=1), RATES)
    descend(first, range(steps))
    descend(second, range(5))
    state = first.state()
    kept = {name: x.clone() for name, x in state.items()}
    second.restore(state)
    descend(second, range(5, 7))
    assert all(torch.equal(x, kept[name]) for name, x in state.items()), "it is copied"
    second.restore(state)
    for optimizer in (first, second):
        descend(optimizer, range(steps, 9))
    require_equal(second.state(), first.state())
