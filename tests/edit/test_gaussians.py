"""StyleSplat on a small ball of 3D Gaussians."""

from dataclasses import replace

import torch

from tests.edit.scenes import RADIUS, sphere_points
from tests.fitting.scenes import cameras
from texgs.edit.gaussians import HIGHER_RATE, stylize_gaussians
from texgs.edit.methods.style_baselines import StyleSplatKeys
from texgs.edit.objective import Objective
from texgs.edit.style_picture import StylePicture
from texgs.fields.gaussians import Gaussians
from texgs.models.pictures import picture

RECIPE = StyleSplatKeys(nnfm=0.0, patches=1.0).recipe(4, 0, reduce=1, rate=0.01)
STYLE = StylePicture.of(picture("dots", 96))


def ball(count=300, degree=1):
    """Gaussians on a sphere."""
    generator = torch.Generator().manual_seed(0)
    return Gaussians(
        {
            "means": RADIUS * sphere_points(count),
            "quats": torch.tensor([1.0, 0, 0, 0]).repeat(count, 1),
            "scales": torch.full((count, 3), -3.5),
            "opacities": torch.full((count,), 3.0),
            "sh": 0.3 * torch.rand(count, (degree + 1) ** 2, 3, generator=generator),
        }
    )


def test_only_harmonics_change(vgg):
    model = ball(degree=2)
    before = {name: x.clone() for name, x in model.parameters.items()}
    recipe = replace(RECIPE, features=1.0)
    edited, losses = stylize_gaussians(model, cameras(3, 48), STYLE, recipe, vgg)
    assert all(torch.equal(model.parameters[name], x) for name, x in before.items()), "left alone"
    same = {name for name, x in before.items() if torch.equal(x, edited.parameters[name])}
    assert same == set(before) - {"sh"}
    assert edited.parameters["sh"].shape == before["sh"].shape
    assert set(losses) == {"nnfm", "patches"}


def test_the_first_step_goes_against_the_gradient_by_its_rate():
    """Adam's first step is the rate times the sign: a twentieth for the higher harmonics."""
    model, views = ball(), cameras(1, 48)
    edited, _ = stylize_gaussians(model, views, STYLE, replace(RECIPE, iterations=1))
    sh = model.parameters["sh"].clone().requires_grad_()
    shown = replace(model, parameters={**model.parameters, "sh": sh}).render(views[0])
    objective = Objective.of(RECIPE, STYLE.scaled(48), 1, None, None)
    sum(objective.terms(shown.color.permute(2, 0, 1), shown.alpha.detach(), 0).values()).backward()
    step, clear = edited.parameters["sh"] - model.parameters["sh"], sh.grad.abs() > 1e-7
    rates = torch.tensor([1, HIGHER_RATE, HIGHER_RATE, HIGHER_RATE])[:, None] * RECIPE.rate
    expected = (-rates * sh.grad.sign())[clear]
    torch.testing.assert_close(step[clear], expected, rtol=1e-3, atol=1e-6)
