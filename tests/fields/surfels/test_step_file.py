"""Files of steps: what comes back, how exactly, and what is refused."""

from dataclasses import replace

import pytest
import torch

from tests.fields.rewritten import rewritten
from tests.fields.surfels.samples import sample
from tests.refusals import refused
from texgs.core.errors import TexgsError
from texgs.core.geometry import quats_to_matrices
from texgs.fields.surfels.step_file import FORMAT, TURNS, UNITS, at_step, write_step

TEXTURE = ("texels", "sizes", "offsets", "palette", "ambient")


def moved(model, seed=1):
    """The model with its surfels elsewhere."""
    generator = torch.Generator().manual_seed(seed)
    p = {
        name: x + 0.2 * torch.randn(x.shape, generator=generator)
        for name, x in model.parameters.items()
        if name in UNITS
    }
    p["quats"] = -3 * p["quats"]  # of another length and sign, the same rotation
    return replace(model, parameters={**model.parameters, **p})


def test_a_step_comes_back_up_to_half_a_unit_and_the_rest_is_the_key_model(tmp_path):
    key = sample()
    key.parameters["normals"] = key.parameters["quats"].flip(1)
    step = moved(key)
    back = at_step(key, write_step(tmp_path / "s", key, step, {"file": "v"})).parameters
    for name in UNITS.keys() & back.keys():
        if name not in TURNS:
            torch.testing.assert_close(back[name], step.parameters[name], atol=0.51 * UNITS[name], rtol=1e-6)
    for name in TURNS:
        turned = (quats_to_matrices(x) for x in (back[name], step.parameters[name]))
        torch.testing.assert_close(*turned, atol=1e-3, rtol=0)
    assert all(back[name] is key.parameters[name] for name in TEXTURE)


def test_what_is_read_and_written_again_is_the_same(tmp_path):
    key = sample()
    once = at_step(key, write_step(tmp_path / "s", key, moved(key), {}))
    again = at_step(key, write_step(tmp_path / "t", key, once, {}))
    assert all(
        torch.equal(x, again.parameters[name]) for name, x in once.parameters.items() if name != "quats"
    )
    torch.testing.assert_close(
        once.parameters["quats"], again.parameters["quats"], atol=2 * UNITS["quats"], rtol=0
    )


def test_a_surfel_has_26_bytes(tmp_path):
    sizes = [
        write_step(tmp_path / "s", key, moved(key), {}).stat().st_size
        for key in (sample(n=100), sample(n=1100))
    ]
    assert sizes[1] - sizes[0] == pytest.approx(26_000, abs=100)


def test_a_difference_that_is_too_large_ends_at_the_largest(tmp_path):
    key = sample()
    far = replace(key, parameters={**key.parameters, "opacities": key.parameters["opacities"] - 1e5})
    back = at_step(key, write_step(tmp_path / "s", key, far, {}))
    assert bool((back.parameters["opacities"] < -25).all())


@pytest.mark.parametrize(
    ("name", "value"),
    [("means", None), ("means", torch.zeros(6, 3, dtype=torch.int16)), ("colors", torch.zeros(7, 3))],
)
def test_a_step_of_another_model_is_refused(tmp_path, name, value):
    key = sample()
    path = write_step(tmp_path / "step", key, moved(key), {})
    refused(lambda: at_step(sample(seed=5), path), f"{path}: .*of another", TexgsError)
    rewritten(path, FORMAT, {name: value})
    refused(lambda: at_step(key, path), f"{path}: .*7 surfels", TexgsError)


def test_a_step_that_is_no_model_of_the_series_is_not_written(tmp_path):
    key, early = sample(), sample("surfels")
    torn = {**key.parameters, "means": torch.full((7, 3), torch.nan)}
    for model, step, named in (
        (key, replace(key, parameters=torn), "means: .*finite"),
        (key, sample(n=8), "means: "),
        (early, early, "got surfels"),
    ):
        refused(lambda m=model, s=step: write_step(tmp_path / "s", m, s, {}), named, TexgsError)
    assert not (tmp_path / "s").exists()
