from dataclasses import replace

import pytest
import torch
from torch.testing import assert_close

from tests.devices import device  # noqa: F401, a fixture
from tests.fitting.scenes import ball_images, ball_seeds, cameras, images_of, random_surfels
from tests.raster.requirements import require_same_bits
from texgs.fields.gaussians import Baked
from texgs.fields.splats import Splats, visible_part, zeroth
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, material
from texgs.fitting.losses import view_loss
from texgs.fitting.settings import Losses
from texgs.raster.losses import bilateral_smoothness, l1_dssim, normal_consistency
from texgs.raster.reference.losses import ssim
from texgs.raster.shading import MATERIAL

OPTICS = ShadingModel()
ALL = Losses(alpha=0.1, normal=0.05, smoothness=0.01)


@pytest.fixture
def target():
    return ball_images().target(1)


def per_surfel():
    """Surfels with a material each that is not the same everywhere."""
    generator = torch.Generator().manual_seed(3)
    p = ball_seeds(60, opacity=0.6)
    n = len(p["means"])
    return p | {name: p[name] + torch.randn(n, generator=generator) for name in MATERIAL}


def photometric(image, target, weight):
    """L1 + D-SSIM from its definition, in float64."""
    image, target = image.double(), target.double()
    return (1 - weight) * (image - target).abs().mean() + weight * (1 - ssim(image, target))


def loss(parameters, target, **weights):
    return float(view_loss(parameters, OPTICS, target, Losses(**weights), None, iteration=10))


def test_color_and_alpha(target):
    """Against the definition in float64; normals count from their iteration on."""
    parameters = per_surfel()
    seen = Surfels(parameters, OPTICS).render(target.camera, target.light)
    color = photometric(seen.color, target.color, 0.2)
    alpha = photometric(seen.alpha[..., None], target.alpha[..., None], 0.2)
    bare = loss(parameters, target, alpha=0.0)
    assert bare == pytest.approx(float(color), rel=1e-4)
    assert loss(parameters, target, alpha=0.5) == pytest.approx(float(color + 0.5 * alpha), rel=1e-4)
    structure = 1 - ssim(seen.alpha[..., None].double(), target.alpha[..., None].double())
    term = loss(parameters, target, alpha=0.5, alpha_l1=False) - bare
    assert term == pytest.approx(float(0.5 * 0.2 * structure), rel=1e-3), "alone at the same weight"
    shared = ball_seeds(60)  # one material for all is smooth already
    assert loss(shared, target, smoothness=5.0) == loss(shared, target)
    assert loss(parameters, target, normal=0.1, normal_from=10) == loss(parameters, target)
    assert loss(parameters, target, normal=0.1, normal_from=9) > loss(parameters, target)


def gradients(parameters, target, turns_normals=True, **weights):
    leaves = {name: x.clone().requires_grad_() for name, x in parameters.items()}
    weights = Losses(**{"alpha": 0.0, **weights})
    view_loss(leaves, OPTICS, target, weights, None, 10, turns_normals).backward()
    return {name: x.grad for name, x in leaves.items()}


def test_shading_turns_normals_unless_told_not_to(target):
    """Spheres seen from afar do not change with their orientation but for their shading."""
    parameters = per_surfel()
    both = [gradients(parameters, target, turns) for turns in (True, False)]
    turned = {**parameters, "diffuse": torch.full((60,), -40.0), "specular": torch.full((60,), -40.0)}
    unlit = gradients(turned, target)
    assert not torch.allclose(both[0]["quats"], both[1]["quats"], rtol=1e-2)
    assert torch.equal(both[0]["colors"], both[1]["colors"]), "the image is the same"
    assert unlit["quats"].abs().max() > 0
    assert torch.allclose(
        unlit["quats"], gradients(turned, target, turns_normals=False)["quats"], rtol=1e-3, atol=1e-9
    ), "without light that depends on normals there is nothing to leave out"


def test_loss_and_gradients_of_the_visible_part_are_those_of_the_view():
    """An independent surfel far to the left, and content far to the right: both count."""
    camera = cameras(1, size=96, distance=4)[0]
    p = random_surfels(7, 30, 0.05, 0.05)
    generator = torch.Generator().manual_seed(1)
    p |= {name: p[name] + torch.randn(30, generator=generator) for name in MATERIAL}
    planes = torch.ones(4, 96, 96)
    planes[3] = 0
    planes[:, 40:52, 70:80] = 0.5
    images = images_of([planes], [camera])
    part, whole = visible_part(images, 0, p, ShadingModel().options), images.target(0)
    assert part.share < 0.6
    results = []
    for target in (part, whole):
        leaves = {name: x.clone().requires_grad_() for name, x in p.items()}
        view_loss(leaves, ShadingModel(), target, ALL, None, iteration=1).backward()
        without_normals = view_loss(p, ShadingModel(), target, replace(ALL, normal=0.0), None, iteration=1)
        results.append((without_normals, {name: x.grad for name, x in leaves.items()}))
    assert_close(results[0][0], results[1][0], rtol=1e-5, atol=0)
    for name, gradient in results[0][1].items():
        scale = float(results[1][1][name].abs().max())
        assert_close(
            gradient, results[1][1][name], rtol=1e-3, atol=1e-4 * scale, msg=lambda m, n=name: f"{n}: {m}"
        )


def by_parts(parameters, shading, target, weights, shift):
    """The same loss of what the rasterizer returns, by functions that have their own tests, and autograd."""
    camera, colors = target.camera, shading.colors(parameters, target.camera, target.light)
    maps = [] if not weights.smoothness else list(material(parameters, "bounded").values())
    features = torch.cat([colors, *(each[:, None] for each in maps)], dim=1)
    white = torch.tensor([1.0] * 3 + [0.0] * len(maps))
    shown = {"features": features, "background": white, "shift": shift, "outputs": ("depth",)}
    shown |= {"outputs": ("normal", "depth")} if weights.normal else {}
    seen = Splats(parameters, shading).rasterized(camera, **shown)
    total = l1_dssim(seen.color[..., :3], target.color, weights.dssim)
    total = total + weights.alpha * l1_dssim(seen.alpha, target.alpha, weights.dssim)
    if weights.normal:
        drawn = (seen.normal, seen.depth, seen.alpha)
        total = total + weights.normal * normal_consistency(*drawn, camera.viewmat, camera.K)
    if maps:
        smoothness = bilateral_smoothness(seen.color[..., 3:], target.color, target.alpha)
        total = total + 4 * weights.smoothness * smoothness
    return target.share * total


def gaussians():
    """3D Gaussians of one colour each."""
    p = ball_seeds(60, opacity=0.6)
    shape = {name: p[name] for name in ("means", "quats", "opacities")}
    sh = zeroth(torch.rand(60, 3, generator=torch.Generator().manual_seed(0)))
    return {
        **shape,
        "scales": torch.cat([p["scales"] - torch.arange(2), p["scales"][:, :1] + 0.5], dim=1),
        "sh": sh,
    }


FITTED = {
    "all": (per_surfel, OPTICS, ALL),
    "color": (ball_seeds, OPTICS, Losses(alpha=0.0)),
    "gaussians": (gaussians, Baked(), Losses()),
}


@pytest.mark.parametrize("name", FITTED)
def test_gradients_are_those_of_the_parts(name, target, device):  # noqa: F811
    given, shading, weights = FITTED[name]
    parameters = given()
    target = replace(target, share=0.5)
    ours, theirs = ({x: y.clone().requires_grad_() for x, y in parameters.items()} for _ in range(2))
    shift_gradient = torch.full((len(parameters["means"]), 2), torch.nan)
    shift = torch.zeros_like(shift_gradient, requires_grad=True)
    loss = view_loss(ours, shading, target, weights, shift_gradient, 1)
    (3 * loss).backward()
    expected = by_parts(theirs, shading, target, weights, shift)
    (3 * expected).backward()
    assert_close(loss, expected, rtol=1e-5, atol=0)
    pairs = {x: (ours[x].grad, theirs[x].grad) for x in parameters} | {
        "shift": (3 * shift_gradient, shift.grad)
    }
    for x, (value, other) in pairs.items():
        scale = float(other.abs().max())
        assert_close(value, other, rtol=2e-4, atol=2e-5 * scale, msg=lambda m, n=x: f"{n}: {m}")


def test_any_number_of_threads_gives_the_same_bits():
    images = ball_images(1, size=150)

    def computed():
        leaves = {name: x.clone().requires_grad_() for name, x in ball_seeds(3000).items()}
        shift_gradient = torch.zeros(3000, 2)
        loss = view_loss(leaves, OPTICS, images.target(0), Losses(normal=0.05), shift_gradient, 1)
        loss.backward()
        return {"loss": loss.detach(), "shift": shift_gradient, **{k: x.grad for k, x in leaves.items()}}

    require_same_bits(computed)


def test_without_gradients_the_value_is_the_same(target):
    with torch.no_grad():
        value = view_loss(per_surfel(), OPTICS, target, ALL, None, 1)
    leaves = {name: x.clone().requires_grad_() for name, x in per_surfel().items()}
    assert torch.equal(value, view_loss(leaves, OPTICS, target, ALL, None, 1).detach())
