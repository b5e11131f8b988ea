"""Small scenes for the tests: random ones, and those that rasterizers get wrong."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import torch
from torch import Tensor

from texgs.raster.types import DEFAULT_OPTIONS, OUTPUTS, Options, Render, Texture

SURFEL_TENSORS = ("means", "quats", "scales", "opacities", "shift", "features")
GEOMETRY = ("means", "quats", "scales", "opacities", "viewmat", "K")
TEXTURE_TENSORS = ("base", "gain", "texels")
TEXTURE_SIZES = ((1, 1), (2, 3), (4, 4), (8, 2), (5, 7), (16, 16), (1, 200), (33, 7), (60, 50))


@dataclass(frozen=True, eq=False)
class Scene:
    """Arguments of one call of the rasterizer."""

    means: Tensor
    quats: Tensor
    scales: Tensor
    opacities: Tensor
    viewmat: Tensor
    K: Tensor
    width: int
    height: int
    features: Tensor | None = None
    texture: Texture | None = None
    background: Tensor | None = None
    shift: Tensor | None = None
    depth_range: Tensor | None = None

    @property
    def outputs(self) -> tuple[str, ...]:
        """All outputs that the scene has: 3D Gaussians have no normal."""
        return tuple(name for name in OUTPUTS if name != "normal" or self.scales.shape[1] == 2)

    @property
    def channels(self) -> int:
        """Channels of the colour."""
        plain = 0 if self.features is None else self.features.shape[1]
        return plain + (0 if self.texture is None else 3)

    def arguments(self) -> dict:
        """Keyword arguments of rasterize."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def geometry(self) -> dict:
        """What splat takes: primitives and camera."""
        return {name: getattr(self, name) for name in (*GEOMETRY, "depth_range")}

    def render(self, rasterize: Callable, outputs=(), options: Options = DEFAULT_OPTIONS) -> Render:
        """Call a rasterizer on this scene."""
        return rasterize(**self.arguments(), outputs=outputs, options=options)

    def map(self, change: Callable[[Tensor], Tensor]) -> Scene:
        """This scene with every tensor changed, those of the texture included."""

        def apply(value):
            if isinstance(value, Texture):
                return Texture(**{field.name: change(getattr(value, field.name)) for field in fields(value)})
            return change(value) if isinstance(value, Tensor) else value

        return Scene(**{name: apply(value) for name, value in self.arguments().items()})

    def double(self) -> Scene:
        """This scene in float64 (integers stay)."""
        return self.map(lambda x: x.double() if x.is_floating_point() else x)

    def to(self, device) -> Scene:
        """This scene on another device."""
        return self.map(lambda x: x.to(device))

    def leaves(self) -> dict[str, Tensor]:
        """The tensors that gradients are defined for, by name."""
        tensors = {name: getattr(self, name) for name in SURFEL_TENSORS}
        if self.texture is not None:
            tensors |= {name: getattr(self.texture, name) for name in TEXTURE_TENSORS}
        return {name: x for name, x in tensors.items() if x is not None}

    def with_leaves(self, leaves: dict[str, Tensor]) -> Scene:
        """This scene with other tensors in place of some of its leaves."""
        own = {name: x for name, x in leaves.items() if name in SURFEL_TENSORS}
        texels = {name: x for name, x in leaves.items() if name in TEXTURE_TENSORS}
        texture = replace(self.texture, **texels) if texels else self.texture
        return replace(self, **own, texture=texture)


def camera(seed: int, width: int, height: int) -> tuple[Tensor, Tensor]:
    """A camera turned at random, 3 away from the origin, principal point off the centre: viewmat and K."""
    generator = torch.Generator().manual_seed(seed)
    R_cw = torch.linalg.qr(torch.randn(3, 3, generator=generator, dtype=torch.float64))[0]
    R_cw = R_cw * torch.linalg.det(R_cw).sign()
    viewmat = torch.eye(4)
    viewmat[:3, :3] = R_cw.float()
    viewmat[2, 3] = 3.0
    focal = 1.3 * max(width, height)
    K = torch.tensor([[focal, 0, 0.47 * width], [0, 1.1 * focal, 0.53 * height], [0, 0, 1]])
    return viewmat, K


def random_scene(seed: int = 0, n: int = 200, width: int = 53, height: int = 37, channels: int = 3) -> Scene:
    """Surfels of all sizes, shapes and opacities in a ball before the camera, over a coloured background."""
    generator = torch.Generator().manual_seed(seed)

    def rand(*shape):
        return torch.rand(*shape, generator=generator)

    viewmat, K = camera(seed, width, height)
    means = torch.randn(n, 3, generator=generator)
    opacities = rand(n)
    opacities[::7] = 1.0
    return Scene(
        means=0.5 * means / means.norm(dim=1, keepdim=True) * (0.2 + rand(n, 1)),
        quats=torch.randn(n, 4, generator=generator),
        scales=0.02 * 15 ** rand(n, 2),  # 0.02 to 0.3: 0.5 to 7 px at 53 x 37
        opacities=opacities,
        viewmat=viewmat,
        K=K,
        width=width,
        height=height,
        features=rand(n, channels),
        background=rand(channels),
    )


def gaussians(scene: Scene) -> Scene:
    """The scene with 3D Gaussians instead of surfels: as thick as 0.05 to 1.5 times their smaller scale."""
    generator = torch.Generator().manual_seed(len(scene.scales))
    thickness = 0.05 * 30 ** torch.rand(len(scene.scales), 1, generator=generator)
    return replace(scene, scales=torch.cat([scene.scales, thickness * scene.scales.amin(1, keepdim=True)], 1))


PRIMITIVES: dict[str, Callable[[Scene], Scene]] = {"surfels": lambda scene: scene, "gaussians": gaussians}


def textured(scene: Scene, sizes=TEXTURE_SIZES, seed: int = 0) -> Scene:
    """The scene with textures instead of features: sizes in turn, texels of surfels in random order."""
    generator = torch.Generator().manual_seed(seed)
    n = len(scene.means)
    texture_sizes = torch.tensor([sizes[i % len(sizes)] for i in range(n)], dtype=torch.int32).reshape(n, 2)
    counts = texture_sizes.long().prod(1)
    order = torch.randperm(n, generator=generator)
    offsets = torch.empty(n, dtype=torch.int64)
    offsets[order] = counts[order].cumsum(0) - counts[order]
    texture = Texture(
        base=torch.rand(n, 3, generator=generator) - 0.3,
        gain=torch.rand(n, generator=generator) + 0.2,
        texels=torch.rand(int(counts.sum()), 3, generator=generator),
        sizes=texture_sizes,
        offsets=offsets,
    )
    background = None if scene.background is None else scene.background[:3]
    return replace(scene, features=None, texture=texture, background=background)


def textured_with_features(scene: Scene, channels: int, seed: int = 0) -> Scene:
    """The scene with textures and so many features beside them."""
    generator = torch.Generator().manual_seed(seed)
    features = torch.rand(len(scene.means), channels, generator=generator)
    background = torch.rand(3 + channels, generator=generator)
    return replace(textured(scene), features=features, background=background)


def few(seed: int = 0, n: int = 12, **changes) -> Scene:
    """A few larger surfels, some of whose tensors are replaced."""
    size = {name: changes.pop(name) for name in ("width", "height") if name in changes}
    scene = random_scene(seed, n, **size)
    return replace(scene, scales=3 * scene.scales, **changes)


def _crossing() -> Scene:
    """Long surfels whose planes run past the camera: near points behind it, far points before it."""
    viewmat = torch.eye(4)
    K = torch.tensor([[40.0, 0, 26], [0, 40, 18], [0, 0, 1]])
    tilt = torch.tensor([80.0, 89.0, 60.0, 85.0]).deg2rad() / 2
    axis = torch.tensor([[1.0, 0], [0, 1], [0.7, 0.7], [0.9, -0.3]])
    return few(
        n=4,
        means=torch.tensor([[0.0, 0.3, 0.5], [-0.2, 0, 1], [0.1, 0.1, 0.4], [0, -0.2, 2]]),
        quats=torch.cat([tilt.cos()[:, None], tilt.sin()[:, None] * axis, torch.zeros(4, 1)], 1),
        viewmat=viewmat,
        K=K,
    ).with_leaves({"scales": torch.tensor([[0.5, 0.8], [0.6, 0.2], [0.4, 0.4], [0.1, 3.0]])})


def _edge_on() -> Scene:
    """Surfels seen exactly, and almost exactly, from the side."""
    angle = torch.tensor([math.pi / 2, math.pi / 2 - 1e-4, math.pi / 2 - 1e-2]) / 2
    quats = torch.stack([angle.cos(), torch.zeros(3), angle.sin(), torch.zeros(3)], 1)
    means = torch.tensor([[0.0, 0, 2], [0.3, 0.1, 2.5], [-0.3, -0.1, 3]])
    return few(n=3, means=means, quats=quats, viewmat=torch.eye(4))


def _coincident() -> Scene:
    """Frontal surfels at three depths only, so that most depths are equal to the last bit."""
    scene = few(n=30, viewmat=torch.eye(4), quats=torch.tensor([[1.0, 0, 0, 0]]).repeat(30, 1))
    means = scene.means.clone()
    means[:, 2] = 2.0 + (torch.arange(30) % 3)
    return replace(scene, means=means)


HARD_CASES: dict[str, Callable[[], Scene]] = {
    "no surfels": lambda: random_scene(n=0),
    "all behind the camera": lambda: few().with_leaves({"means": few().means - 10 * few().viewmat[2, :3]}),
    "crossing the camera plane": _crossing,
    "edge-on": _edge_on,
    "smaller than a pixel": lambda: few().with_leaves({"scales": few().scales * 1e-4}),
    "larger than the image": lambda: few().with_leaves({"scales": few().scales * 50}),
    "needles": lambda: few().with_leaves({"scales": few().scales * torch.tensor([10.0, 1e-3])}),
    "opacity 0": lambda: few().with_leaves({"opacities": torch.zeros(12)}),
    "opacity below 1/255": lambda: few().with_leaves({"opacities": torch.full((12,), 0.0039)}),
    "opacity 1": lambda: few().with_leaves({"opacities": torch.ones(12)}),
    "coincident depths": _coincident,
    "1x1 image": lambda: few(width=1, height=1),
    "161x89 image": lambda: few(n=4, width=161, height=89),
    "1x200 image": lambda: few(width=1, height=200),
    "far off the image": lambda: few().with_leaves({"means": few().means + 4 * few().viewmat[0, :3]}),
}


SURFEL_OPTIONS = (
    Options(low_pass=6.0),
    Options(low_pass=64.0),
    Options(low_pass=1e30),
    Options(filter_sigma=1.0),
    Options(filter_sigma=3.0),
    Options(near=2.9),
    Options(transmittance_min=0.3),
)
GAUSSIAN_OPTIONS = (
    Options(dilation=0.1),
    Options(dilation=3.0),
    Options(antialiased=True),
    Options(antialiased=True, dilation=1.0),
    Options(near=2.9),
    Options(transmittance_min=0.3),
)
OTHER_OPTIONS = (Options(near=0.01, far=1e10), Options(alpha_min=0.05))


def described(options):
    """Return what of the options is no default, as the name of a test."""
    changed = {name: value for name, value in vars(options).items() if value != vars(DEFAULT_OPTIONS)[name]}
    return ",".join(f"{name}={value:g}" for name, value in changed.items())
