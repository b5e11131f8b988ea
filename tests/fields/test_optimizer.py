import pytest
import torch

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


def oracle(steps, values):
    """Parameters after steps of torch.optim.Adam as it comes."""
    leaves = {name: values[name].clone().requires_grad_() for name in RATES}
    adam = torch.optim.Adam([{"params": [x], "lr": 0.0} for x in leaves.values()], eps=1e-15)
    for step in steps:
        for group, (name, x) in zip(adam.param_groups, leaves.items(), strict=True):
            group["lr"] = RATES[name].start * RATES[name].final ** (step / 10)
            x.grad = gradient(name, x.detach(), step)
        adam.step()
    return leaves


def assert_close(optimizer, expected, rows=slice(None)):
    for name, x in expected.items():
        rows_of = x.detach() if name == "ambient" else x.detach()[rows]
        value = optimizer.parameters[name].detach()[: len(rows_of)]
        torch.testing.assert_close(value, rows_of, rtol=1e-5, atol=1e-6)  # fused and plain round differently


def test_it_is_adam_with_a_rate_for_each_parameter():
    optimizer = Optimizer(parameters(), RATES)
    descend(optimizer, range(8))
    assert_close(optimizer, oracle(range(8), parameters()))
    rate = Rate(0.02, 0.01)
    assert [rate.at(t) for t in (0.0, 0.5, 1.0)] == pytest.approx([0.02, 0.002, 0.0002])


def test_parameters_without_a_rate_are_constant_and_given_ones_stay_untouched():
    given = parameters()
    optimizer = Optimizer(given, RATES)
    descend(optimizer, range(3))
    assert not optimizer.parameters["still"].requires_grad
    assert torch.equal(optimizer.parameters["still"], torch.ones(6))
    for name, x in parameters().items():
        assert torch.equal(given[name], x)


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
    for moment in ("exp_avg", "exp_avg_sq"):
        assert torch.equal(state[f"adam.means.{moment}"][4:], torch.zeros(2, 3))
        assert (state[f"adam.means.{moment}"][:4] != 0).all()
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
    assert not state["adam.opacities.exp_avg"].any()
    assert not state["adam.opacities.exp_avg_sq"].any()
    assert torch.equal(state["adam.means.exp_avg"], before["adam.means.exp_avg"])
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
    assert first.state().keys() == second.state().keys()
    for name, x in first.state().items():
        assert torch.equal(second.state()[name], x), name
