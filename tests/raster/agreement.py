"""How tests compare a rasterizer with the definition.

The definition has thresholds: a fragment counts or it does not, a pixel ends or it does not. Where even the
definition changes its mind when inputs move by a thousandth, float32 may decide otherwise and be right; such
pixels are left out of comparisons ("undecided"), and all others must agree closely.
"""

import pickle
from dataclasses import replace
from functools import lru_cache, wraps

import torch

from texgs.raster.api import rasterize
from texgs.raster.reference import render as reference
from texgs.raster.reference.fragments import ALPHA_MAX, within
from texgs.raster.reference.render import TEXTURE_SIGMA, composite, kind_of, pixel_centres
from texgs.raster.types import DEFAULT_OPTIONS

# Absolute tolerances. Colours and alpha are sums of numbers below 1 in float32, whose exponents carry the
# rounding of the intersection; depths are around 3; the distortion is at most 0.003 in these scenes.
TOLERANCE = {"color": 3e-5, "alpha": 3e-5, "depth": 3e-5, "median": 3e-5, "normal": 5e-5, "distortion": 1e-7}
TEXEL = 2e-6  # more for each texel that the textures span, as their random colours change from texel to texel
UNDECIDED = 0.15  # largest share of pixels that may sit on a threshold (or, textured, on a texel centre)
# Relative L2 of gradients, by tensor. Colours enter linearly and only carry the rounding of the weights.
# Geometry is a sum of terms that cancel, led by few tilted surfels whose intersections lose digits; the
# definition itself, in float32, has errors up to 1e-4 (means) and 2e-4 (quats) on such scenes.
GRADIENT_TOLERANCE = {
    "means": 5e-4,
    "quats": 1e-3,
    "scales": 2e-4,
    "opacities": 1e-4,
    "shift": 2e-4,
    "features": 5e-5,
    "base": 5e-5,
    "gain": 1e-4,
    "texels": 2e-4,
}
MARGIN = 1e-3
IMAGES = ("color", "alpha", "depth", "median", "normal", "distortion")


def remembered(function):
    """Compute once for equal arguments: several libraries are compared with one definition, which is slow."""

    @lru_cache(maxsize=100)
    def of(pickled):
        return function(*pickle.loads(pickled))

    return wraps(function)(lambda *arguments: of(pickle.dumps(arguments)))


def decided(scene, options=DEFAULT_OPTIONS):
    """Pixels [H, W] in which no threshold is close, nor a kink of a texture."""
    return decided_by_geometry(replace(scene, features=None, background=None), options)


@remembered
def decided_by_geometry(scene, options):
    """The same of a scene without colours, which many scenes share."""
    scene = scene.double()
    counts = decisions(scene, options)
    same = ~near_texel_centre(scene, options)
    for factor in (1 - MARGIN, 1 + MARGIN):
        brighter = replace(scene, opacities=scene.opacities * factor)
        names = ("low_pass", "transmittance_min", "near")
        thresholds = {name: factor * getattr(options, name) for name in names}
        farther = (
            scene if scene.depth_range is None else replace(scene, depth_range=factor * scene.depth_range)
        )
        for other in (decisions(brighter, options), decisions(farther, replace(options, **thresholds))):
            same &= (counts == other).all(1)
    return same.reshape(scene.height, scene.width)


def dense(scene, options):
    """Every primitive at every pixel: as projected, fragments, weights [P, M], light before each [P, M]."""
    kind, size = kind_of(scene.scales), (scene.width, scene.height)
    geometry = (scene.means, scene.quats, scene.scales, scene.opacities, scene.viewmat, scene.K)
    projected = kind.project(*geometry, scene.shift, size, options)
    fragments = kind.intersect(projected, pixel_centres(*size, scene.means), options)
    fragments = within(fragments, scene.depth_range)
    return projected, fragments, *composite(fragments.alpha, options.transmittance_min)


def decisions(scene, options):
    """How many fragments of each pixel fall on one side of each threshold, [P, 4]."""
    surfels, fragments, weights, light = dense(scene, options)
    blended = weights > 0
    filtered = fragments.depth == surfels.depth
    sides = (blended, blended & filtered, blended & (fragments.alpha == ALPHA_MAX), blended & (light > 0.5))
    return torch.stack([side.sum(1) for side in sides], 1)


def near_texel_centre(scene, options):
    """Pixels [P] with a fragment next to a texel centre, where bilinear interpolation has a kink."""
    if scene.texture is None:
        return torch.zeros(scene.height * scene.width, dtype=torch.bool)
    surfels, fragments, weights, _ = dense(scene, options)
    near = torch.zeros_like(weights, dtype=torch.bool)
    for axis, coordinate in enumerate((fragments.u, fragments.v)):
        size = scene.texture.sizes[surfels.index, axis]
        x = (coordinate / (2 * TEXTURE_SIGMA) + 0.5) * size - 0.5
        inside = (x > -MARGIN) & (x < size - 1 + MARGIN)
        near |= inside & ((x - x.round()).abs() < MARGIN)
    return (near & (weights > 0)).any(1)


def names_of(scene):
    """The names of all images that a scene has."""
    return tuple(name for name in IMAGES if name in ("color", "alpha", *scene.outputs))


def images(render):
    """The images that a Render holds, by name."""
    return {name: getattr(render, name) for name in IMAGES if getattr(render, name) is not None}


def relative(result, expected):
    """Distance of two tensors in units of the length of the second; the distance itself where that is 0."""
    difference = (result.detach().cpu().double() - expected).norm()
    length = expected.norm()
    return float(difference / length if length > 0 else difference)


def gradients(rasterize, scene, cotangents, options=DEFAULT_OPTIONS, wanted=None):
    """Gradients by name of sum(cotangent * image) with respect to the scene's leaves (or those `wanted`)."""
    leaves = {name: x for name, x in scene.leaves().items() if wanted is None or name in wanted}
    leaves = {name: x.detach().clone().requires_grad_() for name, x in leaves.items()}
    outputs = tuple(name for name in cotangents if name not in ("color", "alpha"))
    rendered = images(scene.with_leaves(leaves).render(rasterize, outputs, options))
    products = (rendered[name] * cotangent.to(rendered[name]) for name, cotangent in cotangents.items())
    total = sum(product.sum() for product in products)
    derivatives = torch.autograd.grad(total, list(leaves.values()), allow_unused=True)
    return {
        name: torch.zeros_like(leaf) if gradient is None else gradient
        for (name, leaf), gradient in zip(leaves.items(), derivatives, strict=True)
    }


@remembered
def true_images(scene, outputs=(), options=DEFAULT_OPTIONS):
    """The images of the definition, by name."""
    return images(scene.double().render(reference.rasterize, outputs, options))


@remembered
def true_gradients(scene, cotangents, options=DEFAULT_OPTIONS, wanted=None):
    """The gradients of the definition, as `gradients`."""
    return gradients(reference.rasterize, scene.double(), cotangents, options, wanted)


def random_cotangents(scene, names, mask=None, seed=0):
    """Random gradients of the images `names`, zero outside the mask [H, W]."""
    generator = torch.Generator().manual_seed(seed)
    channels = {"color": (scene.channels,), "normal": (3,)}
    cotangents = {}
    for name in names:
        shape = (scene.height, scene.width, *channels.get(name, ()))
        cotangent = torch.randn(shape, generator=generator, dtype=torch.float64)
        keep = torch.ones(shape[:2], dtype=torch.bool) if mask is None else mask
        cotangents[name] = cotangent * keep.reshape(*shape[:2], *[1] * (len(shape) - 2))
    return cotangents


def check_images(scene, device, options=DEFAULT_OPTIONS, tolerance=TOLERANCE, least_alike=0.9):
    """Compare the images of a scene that have a tolerance, pixel by pixel where the definition is sure."""
    outputs = [name for name in scene.outputs if name != "statistics"]
    rendered = images(scene.to(device).render(rasterize, outputs, options))
    expected = true_images(scene, outputs, options)
    sure = decided(scene, options)
    assert 1 - sure.double().mean() < UNDECIDED
    assert rendered["alpha"].max() <= 1
    texels = 0 if scene.texture is None else int(scene.texture.sizes.max())
    for name in names_of(scene):
        assert rendered[name].shape == expected[name].shape
        assert rendered[name].dtype == torch.float32
        assert rendered[name].isfinite().all()
        if name in tolerance:
            error = (rendered[name].cpu() - expected[name]).abs()
            assert float(error[sure].max()) < tolerance[name] + TEXEL * texels * (name == "color"), name
            alike = (error[~sure] < 0.02).double().mean()  # a weak fragment more or less
            assert sure.all() or alike > least_alike, name


def check_gradients(
    scene,
    device,
    names=("color",),
    options=DEFAULT_OPTIONS,
    wanted=None,
    tolerance=GRADIENT_TOLERANCE,
    least=1e-9,
):
    """Compare the gradients of random combinations of the images `names` in pixels off all thresholds.

    Those of a length below `least` are rounding, as of the scales on the median depth.
    """
    names = [name for name in names if name in names_of(scene)]
    if not names:
        return  # Gaussians have no normal
    cotangents = random_cotangents(scene, names, decided(scene, options))
    derivatives = gradients(rasterize, scene.to(device), cotangents, options, wanted)
    for name, gradient in true_gradients(scene, cotangents, options, wanted).items():
        assert derivatives[name].shape == gradient.shape
        assert derivatives[name].isfinite().all()
        if gradient.norm() < least:
            assert derivatives[name].norm() < max(1e-2 * (least < 1e-6), 1e-3), name
        else:
            assert relative(derivatives[name], gradient) < tolerance[name], name
