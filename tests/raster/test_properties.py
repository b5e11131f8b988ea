"""What must hold for every scene, whatever the rasterizer's arithmetic."""

from dataclasses import replace

import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.raster.agreement import gradients, images, names_of, random_cotangents
from tests.raster.requirements import require_equal
from tests.raster.scenes import PRIMITIVES, random_scene, textured
from texgs.raster.api import rasterize
from texgs.raster.types import OUTPUTS, Options, Texture

scenes = st.builds(
    random_scene,
    seed=st.integers(0, 10_000),
    n=st.integers(0, 120),
    width=st.integers(1, 70),
    height=st.integers(1, 50),
)
of_all = st.builds(lambda scene, kind: PRIMITIVES[kind](scene), scenes, st.sampled_from(sorted(PRIMITIVES)))
examples = settings(
    max_examples=25,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],  # one device serves all examples of a test
)
CLOSE = {"rtol": 0, "atol": 2e-5}  # float32 sums in another order
UNENDED = Options(transmittance_min=0.0)


def select(scene, index):
    """Some surfels of a scene, in a new order."""
    return scene.with_leaves({name: leaf[index] for name, leaf in scene.leaves().items()})


@examples
@given(scene=of_all, seed=st.integers(0, 100))
def test_order_of_the_surfels_does_not_matter(device, scene, seed):
    n = len(scene.means)
    order = torch.randperm(n, generator=torch.Generator().manual_seed(seed))
    first = images(scene.to(device).render(rasterize, scene.outputs))
    second = images(select(scene, order).to(device).render(rasterize, scene.outputs))
    require_equal(second, first)  # depths differ, so the order of blending does not
    cotangents = random_cotangents(scene, [name for name in ("color", "normal") if name in names_of(scene)])
    first = gradients(rasterize, scene.to(device), cotangents)
    second = gradients(rasterize, select(scene, order).to(device), cotangents)
    for name, gradient in first.items():
        torch.testing.assert_close(gradient[order.to(device)], second[name], rtol=1e-4, atol=1e-4)


@examples
@given(scene=scenes, width=st.integers(1, 9), height=st.integers(1, 40))
def test_constant_texture_is_a_constant_colour(device, scene, width, height):
    n = len(scene.means)
    base, gain = torch.rand(n, 3), torch.rand(n)
    textured_scene = textured(scene, [(width, height)])
    texture = Texture(
        base=base,
        gain=gain,
        texels=scene.features.repeat_interleave(width * height, 0),
        sizes=textured_scene.texture.sizes,
        offsets=torch.arange(n) * width * height,
    )
    constant = replace(scene, features=base + gain[:, None] * scene.features)
    plain = constant.to(device).render(rasterize, OUTPUTS)
    rendered = replace(textured_scene, texture=texture).to(device).render(rasterize, OUTPUTS)
    for name, image in images(plain).items():
        torch.testing.assert_close(getattr(rendered, name), image, **CLOSE)


@examples
@given(front=of_all, seed=st.integers(0, 10_000), n=st.integers(0, 120))
def test_union_of_a_front_and_a_back_set_is_their_composite(device, front, seed, n):
    view = {name: getattr(front, name) for name in ("viewmat", "K", "width", "height")}
    back = replace(random_scene(seed, n), **view)
    back = replace(back, means=back.means + 2 * front.viewmat[2, :3])  # both balls have a radius of 0.6
    if front.scales.shape[1] == 3:
        back = PRIMITIVES["gaussians"](back)
    joined = {name: torch.cat([leaf, back.leaves()[name]]) for name, leaf in front.leaves().items()}
    both = front.with_leaves(joined)
    normal = set(front.outputs) & {"normal"}
    over, under, union = (
        replace(scene, background=None).to(device).render(rasterize, normal, UNENDED)
        for scene in (front, back, both)
    )
    light = (1 - over.alpha)[..., None]
    torch.testing.assert_close(union.color, over.color + light * under.color, **CLOSE)
    torch.testing.assert_close(union.alpha, over.alpha + light[..., 0] * under.alpha, **CLOSE)
    if normal:
        torch.testing.assert_close(union.normal, over.normal + light * under.normal, **CLOSE)


@examples
@given(scene=of_all, opaque=st.booleans())
def test_ranges(device, scene, opaque):
    if opaque:
        scene = replace(scene, opacities=torch.ones_like(scene.opacities))
    render = scene.to(device).render(rasterize, scene.outputs)
    depth = scene.means @ scene.viewmat[2, :3] + 3
    assert (render.alpha >= 0).all()
    assert (render.alpha <= 1).all()
    assert (render.color >= -1e-6).all()
    assert (render.color <= 1 + 1e-5).all()  # features and background lie in [0, 1]
    if render.normal is not None:
        assert (render.normal.norm(dim=-1) <= render.alpha + 1e-5).all()
    assert (render.distortion >= -1e-6).all()
    reach = 4 * 0.3  # the farthest that a fragment of the largest surfel lies from its mean
    for image in (render.depth, render.median):
        seen = image != 0
        assert (image[seen] > 0.2).all()
        assert not seen.any() or (image[seen] < float(depth.max()) + reach).all()
    assert ((render.depth > 0) == (render.alpha > 0)).all()


@examples
@given(scene=of_all, factor=st.sampled_from([-1.0, 3.0, 1e-3]))
def test_length_and_sign_of_quaternions_do_not_matter(device, scene, factor):
    first = images(scene.to(device).render(rasterize, scene.outputs))
    second = images(replace(scene, quats=factor * scene.quats).to(device).render(rasterize, scene.outputs))
    differ = sum(((image - second[name]).abs() > 1e-4).sum() for name, image in first.items())
    assert differ <= 0.02 * sum(image.numel() for image in first.values())  # thresholds
