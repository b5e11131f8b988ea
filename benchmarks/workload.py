"""A scene ready to be rendered, differentiated and stepped through the torch interface."""

from collections.abc import Callable, Collection
from dataclasses import dataclass

import torch
from torch import Tensor

from benchmarks import scenes
from benchmarks.timing import Case
from texgs.core.camera import Camera
from texgs.raster import Options, Render, Texture, rasterize

PLAIN = ("means", "quats", "scales", "opacities", "features")
GEOMETRY = PLAIN[:4]


@dataclass
class Workload:
    """Arguments of `rasterize`, the tensors among them that learn, and gradients of the images."""

    arguments: dict
    learned: list[Tensor]
    cotangents: dict[str, Tensor]
    render: Render | None = None

    def __post_init__(self) -> None:
        for tensor in self.learned:
            tensor.requires_grad_()
        # A rate of 0 costs the same and leaves the scene as heavy as it is.
        self.optimizer = torch.optim.Adam(self.learned, lr=0.0, fused=True) if self.learned else None

    @torch.no_grad()
    def image(self) -> Render:
        """Render without gradients."""
        return rasterize(**self.arguments)

    def forward(self) -> None:
        """Render for `backward`."""
        for tensor in self.learned:
            tensor.grad = None
        self.render = rasterize(**self.arguments)

    def backward(self) -> None:
        """Gradients of the learned tensors from constant gradients of the images."""
        images = [getattr(self.render, name) for name in self.cotangents]
        torch.autograd.backward(images, list(self.cotangents.values()))
        self.render = None  # a training loop lets go of the graph here, too

    def adam(self) -> None:
        """One step of the fused Adam on all learned tensors."""
        self.optimizer.step()

    @property
    def forward_backward(self) -> dict[str, Callable[[], None]]:
        """The phases of a pass with gradients."""
        return {"forward with gradients": self.forward, "backward": self.backward}

    def cases(self, where: dict) -> list[Case]:
        """Return what is timed: a pass without gradients, and one with them."""
        with_gradients = Case("forward+backward", where, self.forward_backward)
        return [Case("forward", where, {"forward": self.image}), with_gradients]


def plain(
    kind: str,
    view: int | Camera,
    n: int,
    device: torch.device,
    *,
    learned: Collection[str] = PLAIN,
    channels: int = 3,
    outputs: tuple[str, ...] = (),
    options: Options | None = None,
    make: Callable[[str, int], dict[str, Tensor]] = scenes.surfels,
) -> Workload:
    """A scene with `channels` features; `view` is a camera or the size of the scenes' own."""
    surfels = _on(device, make(kind, n))
    surfels["features"] = surfels["features"].repeat(1, -(-channels // 3))[:, :channels].contiguous()
    return _workload(surfels, {}, view, device, learned, channels, outputs, options)


def textured(kind: str, size: int, n: int, device: torch.device, texels: tuple[int, int]) -> Workload:
    """A scene with textures of random sizes between the two numbers of texels; only the texels learn."""
    surfels = _on(device, scenes.surfels(kind, n))
    base = surfels.pop("features")
    low, high = texels
    generator = torch.Generator().manual_seed(1)
    sizes = torch.randint(low, high + 1, (n, 2), generator=generator, dtype=torch.int32)
    ends = sizes.long().prod(1).cumsum(0)
    values = 0.2 * torch.rand(int(ends[-1]), 3, generator=generator) - 0.1
    offsets = ends - sizes.long().prod(1)
    gain = torch.ones(n, device=device)
    texture = Texture(base, gain, values.to(device), sizes.to(device), offsets.to(device))
    extra = {"texture": texture, "texels": texture.texels}
    return _workload(surfels, extra, size, device, ("texels",), 3, (), None)


def interleaved(images: dict[str, Tensor]) -> dict[str, Tensor]:
    """Images in the memory order [H, W, C], which peers expect."""
    return {name: x.contiguous() for name, x in images.items()}


def _on(device: torch.device, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    return {name: x.to(device) for name, x in tensors.items()}


def _workload(
    surfels: dict[str, Tensor],
    extra: dict,
    view: int | Camera,
    device: torch.device,
    learned: Collection[str],
    channels: int,
    outputs: tuple[str, ...],
    options: Options | None,
) -> Workload:
    camera = (scenes.camera(view) if isinstance(view, int) else view).to(device)
    planes = {"color": channels, "normal": 3, "depth": 0, "median": 0, "distortion": 0}
    generator = torch.Generator(device).manual_seed(2)

    def random(planes: int) -> Tensor:
        """Gradient of an image in the planar memory in which the losses return it."""
        shape = (planes or 1, camera.height, camera.width)
        values = torch.randn(shape, generator=generator, device=device)
        return values.permute(1, 2, 0) if planes else values[0]

    tensors = surfels | extra
    leaves = [tensors[name] for name in learned]
    tensors.pop("texels", None)
    tensors |= {"viewmat": camera.viewmat, "K": camera.K, "width": camera.width, "height": camera.height}
    tensors |= {"outputs": outputs, "options": options or Options()}
    images = ("color", *(name for name in outputs if name in planes))
    return Workload(tensors, leaves, {name: random(planes[name]) for name in images})
