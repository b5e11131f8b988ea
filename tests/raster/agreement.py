"""How tests compare a rasterizer with the definition.

The definition has thresholds: a fragment counts or it does not, a pixel ends or it does not. Where even the
definition changes its mind when inputs move by a thousandth, float32 may decide otherwise and be right; such
pixels are left out of comparisons ("undecided"), and all others must agree closely.
"""

import pickle
from dataclasses import replace
from functools import lru_cache, wraps

import torch

from texgs.raster.reference import render as reference
from texgs.raster.reference.fragments import ALPHA_MAX
from texgs.raster.reference.render import TEXTURE_SIGMA, composite, kind_of, pixel_centres
from texgs.raster.types import DEFAULT_OPTIONS

MARGIN = 1e-3
IMAGES = ("color", "alpha", "depth", "median", "normal", "distortion")


def remembered(function):
    """Compute once for equal arguments: several libraries are compared with one definition, which is slow."""

    @lru_cache(maxsize=100)
    def of(pickled):
        return function(*pickle.loads(pickled))

    return wraps(function)(lambda *arguments: of(pickle.dumps(arguments)))


@remembered
def decided(scene, options=DEFAULT_OPTIONS):
    """Pixels [H, W] in which no threshold is close, nor a kink of a texture."""
    scene = scene.double()
    counts = decisions(scene, options)
    same = ~near_texel_centre(scene, options)
    for factor in (1 - MARGIN, 1 + MARGIN):
        brighter = replace(scene, opacities=scene.opacities * factor)
        thresholds = {
            name: getattr(options, name) * factor for name in ("low_pass", "transmittance_min", "near")
        }
        for other in (decisions(brighter, options), decisions(scene, replace(options, **thresholds))):
            same &= (counts == other).all(1)
    return same.reshape(scene.height, scene.width)


def dense(scene, options):
    """Every primitive at every pixel: as projected, fragments, weights [P, M], light before each [P, M]."""
    kind, size = kind_of(scene.scales), (scene.width, scene.height)
    geometry = (scene.means, scene.quats, scene.scales, scene.opacities, scene.viewmat, scene.K)
    projected = kind.project(*geometry, scene.shift, size, options)
    fragments = kind.intersect(projected, pixel_centres(*size, scene.means), options)
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
    total = sum(
        (rendered[name] * cotangent.to(rendered[name])).sum() for name, cotangent in cotangents.items()
    )
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
