"""The differentiable functions beside the rasterizer: each with its definition, and inputs of any size."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import torch
from torch.nn.functional import normalize

from texgs.core.camera import orbit, orbit_direction
from texgs.raster import hash_encoding, losses, shading
from texgs.raster.reference import losses as loss_definition
from texgs.raster.reference import shading as shading_definition
from texgs.raster.reference import voxels as hash_definition
from texgs.raster.shading import MATERIAL

CAMERA = torch.tensor([0.5, 1.0, 3.0])
LIGHTS = {"headlight": None, "directional": 2.5 * orbit_direction(30, 50).float()}
LEVELS = hash_encoding.HashLevels(levels=5, entries=512, coarsest=4, finest=50)  # the first needs no hash
FEW_LEVELS = hash_encoding.HashLevels(levels=2, entries=8, coarsest=2, finest=3)


@dataclass(frozen=True)
class Operation:
    """A function of the library, what defines it, and on what they are compared."""

    native: Callable
    definition: Callable
    inputs: Callable[..., dict]  # arguments by name, for a size
    leaves: tuple[str, ...]  # those that have a gradient
    constants: tuple[str, ...]  # those that must not ask for one
    sizes: tuple[tuple, ...]
    small: tuple  # size for finite differences
    large: tuple  # size for which threads meet
    tolerances: tuple[float, float]  # of values and gradients, relative to their lengths; float32


def pair(height, width, channels, noise=0.1):
    """Return planar images in [0, 1]: a smooth target, and the target with noise."""
    generator = torch.Generator().manual_seed(height * width)
    y, x = torch.meshgrid(torch.linspace(0, 3, height), torch.linspace(0, 4, width), indexing="ij")
    target = torch.stack([0.5 + 0.5 * torch.sin(x * (c + 1) + y * y) for c in range(channels)])
    image = (target + noise * torch.randn(target.shape, generator=generator)).clamp(0, 1)
    return {"image": image.permute(1, 2, 0), "target": target.permute(1, 2, 0)}


def maps(height, width, channels):
    """Return attribute, guide and alpha, planar in memory."""
    generator = torch.Generator().manual_seed(height * width)
    planes = torch.rand(channels + 4, height, width, generator=generator)
    guide = 0.3 * planes[channels:-1].permute(1, 2, 0)
    return {"attribute": planes[:channels].permute(1, 2, 0), "guide": guide, "alpha": planes[-1]}


def bumps(height, width, hole=True):
    """Return depth and camera of a bumpy surface, with a hole in it or without."""
    camera = orbit(30, 20, 3.0, 40.0, width, height)
    generator = torch.Generator().manual_seed(height * width)
    y, x = torch.meshgrid(torch.linspace(0, 3, height), torch.linspace(0, 4, width), indexing="ij")
    depth = 2 + 0.3 * torch.sin(2 * x + y * y) + 0.01 * torch.rand(height, width, generator=generator)
    if hole:  # a step, which finite differences cannot cross
        depth[height // 3 : height // 2, width // 3 : width // 2] = 0
    return {"depth": depth, "viewmat": camera.viewmat, "K": camera.K}


def bumps_with_normals(*size):
    """Return the same with random normals and alpha."""
    surface, generator = bumps(*size), torch.Generator().manual_seed(size[0])
    normal = normalize(torch.randn(*size[:2], 3, generator=generator), dim=-1)
    return surface | {"normal": normal, "alpha": torch.rand(size[:2], generator=generator)}


def surfels(n, shared=(), light="headlight"):
    """Return n surfels in a light; parameters of the material in `shared` are one for all."""
    generator = torch.Generator().manual_seed(n)

    def uniform(low, high, *size):
        return low + (high - low) * torch.rand(*size, generator=generator)

    ranges = {"ambient": (0.1, 0.6), "diffuse": (0.2, 0.9), "specular": (0.1, 0.9), "shininess": (1.5, 40.0)}
    material = {name: uniform(*limits, 1 if name in shared else n) for name, limits in ranges.items()}
    given = {"color": uniform(0, 1, n, 3), **material, "means": uniform(-0.5, 0.5, n, 3)}
    given |= {"quats": uniform(-1, 1, n, 4), "camera_position": CAMERA}
    return given if LIGHTS[light] is None else given | {"light": LIGHTS[light]}


RANGES = {"diffuse": (0.0, 1.0), "specular": (0.0, 5.0), "shininess": (1.0, 40.0)}


def raw_surfels(n, shared=()):
    """Return the same with raw numbers for a material, and colours of which light makes some too bright."""
    generator = torch.Generator().manual_seed(n + 1)
    given = surfels(n, shared, "directional")
    given |= {name: torch.randn(len(given[name]), generator=generator) - 1 for name in RANGES}
    return given | {"color": 2 * given["color"] - 0.2}


def raw_blinn_phong(**given):
    """Return the definition's base, clamped, and gain of surfels whose material is raw."""
    factors = {name: low + (high - low) * given[name].sigmoid() for name, (low, high) in RANGES.items()}
    base, gain = shading_definition.blinn_phong(**{**given, **factors}, facing=True)
    return base.clamp(0, 1), gain


def harmonics(n, degree):
    """Return spherical harmonics of n surfels."""
    generator = torch.Generator().manual_seed(n + degree)
    sh, means = (torch.randn(n, k, 3, generator=generator) for k in ((degree + 1) ** 2, 1))
    return {"sh": sh, "means": means[:, 0], "camera_position": CAMERA}


def points(n, levels=LEVELS):
    """Return points, some on faces and some outside of the cube, and a table."""
    generator = torch.Generator().manual_seed(0)
    places = 1.1 * torch.rand(max(n, 8), 3, generator=generator) - 0.05
    places[:8] = torch.cartesian_prod(*[torch.tensor([0.0, 1.0])] * 3)
    return {"points": places[:n], "table": torch.randn(levels.rows, 2, generator=generator)}


def of_losses(name, inputs, leaves, constants, sizes, small, large, tolerances, **settings):
    """Return an operation of `texgs.raster.losses`."""
    functions = (partial(getattr(module, name), **settings) for module in (losses, loss_definition))
    return Operation(*functions, inputs, leaves, constants, sizes, small, large, tolerances)


def of_shading(light, facing):
    """Return Blinn-Phong shading of textured surfels."""
    functions = (partial(module.blinn_phong, facing=facing) for module in (shading, shading_definition))
    constants = ("camera_position",) if light == "headlight" else ("camera_position", "light")
    sizes = tuple((n, shared) for n in (1, 17, 3001) for shared in ((), ("shininess", "specular"), MATERIAL))
    inputs, leaves = partial(surfels, light=light), ("color", *MATERIAL, "means", "quats")
    large = (5000, ("diffuse", "shininess"))
    # a power of 40 amplifies the rounding of its base and of log2 as much
    return Operation(*functions, inputs, leaves, constants, sizes, (5,), large, (2e-6, 1e-5))


IMAGES = (pair, ("image",), ("target",))
SIZES = ((1, 1, 3), (33, 7, 1), (7, 33, 4), (150, 300, 3), (359, 641, 1))
CANCELLING = (1e-5, 1e-5)  # variances cancel in float32, where plain torch reaches 4e-5
DEPTHS = ((1, 1), (3, 3), (2, 40), (33, 7), (7, 33), (70, 130))
MAPS = ((1, 1, 1), (2, 3, 4), (33, 7, 1), (7, 33, 4), (150, 300, 2), (359, 641, 1))

OPERATIONS = {
    "ssim": of_losses("ssim", *IMAGES, ((45, 70, 3),), (5, 6, 2), (359, 641, 3), (1e-6, 1e-5)),
    **{
        f"l1_dssim, lambda {x}": of_losses(
            "l1_dssim", *IMAGES, SIZES, (5, 6, 2), (359, 641, 3), CANCELLING, lambda_dssim=x
        )
        for x in (0.0, 0.2, 1.0)
    },
    "smoothness": of_losses(
        *("bilateral_smoothness", maps, ("attribute",), ("guide", "alpha")),
        *(MAPS, (5, 6, 2), (359, 641, 2), (1e-6, 2e-6)),
    ),
    "depth_to_normal": of_losses(  # differences of neighbouring depths lose a digit
        *("depth_to_normal", bumps, ("depth",), ("viewmat", "K")),
        *(DEPTHS, (6, 7, False), (201, 97), (5e-6, 5e-6)),
    ),
    "normal_consistency": of_losses(
        *("normal_consistency", bumps_with_normals, ("normal", "depth"), ("viewmat", "K")),
        *(DEPTHS, (6, 7, False), (201, 97), (1e-6, 5e-6)),
    ),
    **{
        f"blinn_phong, {light}{', facing' if facing else ''}": of_shading(light, facing)
        for light in LIGHTS
        for facing in (False, True)
    },
    "blinn_phong, raw": Operation(
        *(partial(shading.blinn_phong, facing=True, ranges=RANGES), raw_blinn_phong, raw_surfels),
        *(("color", *MATERIAL, "means", "quats"), ("camera_position", "light")),
        tuple((n, shared) for n in (1, 17, 3001) for shared in ((), MATERIAL)),
        *((5,), (5000, ("diffuse", "shininess")), (2e-6, 1e-5)),
    ),
    "spherical_harmonics": Operation(
        *(shading.spherical_harmonics, shading_definition.spherical_harmonics, harmonics),
        *(("sh", "means"), ("camera_position",)),
        tuple((n, degree) for n in (1, 17, 3001) for degree in range(4)),
        *((4, 3), (5000, 3), (1e-6, 2e-6)),
    ),
}
ON_CPU = {  # without a CUDA kernel
    f"hash_encoding, {levels.levels} levels": Operation(
        *(partial(module.encode, levels=levels) for module in (hash_encoding, hash_definition)),
        *(partial(points, levels=levels), ("table",), ("points",), ((0,), (1,), (31,), (700,))),
        *((20,), (40_000,), (1e-5, 1e-5)),
    )
    for levels in (FEW_LEVELS, LEVELS)
}


def evaluate(function, arguments, leaves):
    """Return the outputs of a function, and the gradients by leaf of their sum under fixed weights."""
    tensors = [arguments[name].detach().requires_grad_() for name in leaves]
    outputs = function(**arguments | dict(zip(leaves, tensors, strict=True)))
    outputs = outputs if isinstance(outputs, tuple) else (outputs,)
    weights = [torch.linspace(-1, 2, x.numel()).reshape(x.shape).to(x) for x in outputs]
    total = sum((w * x).sum() for w, x in zip(weights, outputs, strict=True))
    total = total + sum(0 * x.sum() for x in tensors)  # images without inner pixels depend on nothing
    return tuple(x.detach() for x in outputs), torch.autograd.grad(total, tensors)


def of_operation(operation, size, device="cpu"):
    """Return the outputs and gradients of the library for inputs of a size, as one tuple."""
    given = {name: x.to(device) for name, x in operation.inputs(*size).items()}
    return sum(evaluate(operation.native, given, operation.leaves), ())
