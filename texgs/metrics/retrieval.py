"""Distances of views from whole pictures, by features that no loss uses: which picture they resemble.

Only the object counts. Views are compared by colours, and by pattern alone.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from importlib.resources import files
from typing import Self

import torch
from safetensors.torch import load
from torch import Tensor
from torch.nn import functional as F

from texgs.fields.field import Composed
from texgs.models.vgg import Vgg
from texgs.scene.scene import Scene
from texgs.volume.cameras import spiral

LAYERS = ("relu4_3", "relu5_3")
VIEWS = 8  # views of a scene
SIZE = 256  # pixels of the longer side of views and pictures
SCALES = (1.0, 0.5)  # of pictures relative to views, as a pattern may have any size
MIN_COVERAGE = 0.7  # least share of a feature's window on the object
MIN_FEATURES = 8  # with fewer features, those partly on the object count too
BINS = 6  # per channel of the histogram
HISTOGRAM = 0.5  # weight of the histograms relative to a layer
CONTRAST_SIGMA = 1 / 16  # of the window that normalises contrast, in image sides
MIN_CONTRAST = 0.02  # smallest contrast to normalise
LUMINANCE = (0.299, 0.587, 0.114)
LIKENESS_FILE = files(__package__) / "likeness.safetensors"  # by `python -m tools.style_likeness`


@dataclass(frozen=True, eq=False)
class Likeness:
    """Features of views or pictures [...] for comparison."""

    colors: Tensor  # [..., C] means and deviations of features
    pattern: Tensor  # [..., C] the same without colours and with one contrast
    histogram: Tensor  # [..., B] shares of colours

    @classmethod
    def stacked(cls, several: "Iterable[Likeness]") -> Self:
        """Stack several along a new first dimension."""
        listed = list(several)
        return cls(*(torch.stack([vars(each)[name] for each in listed]) for name in vars(listed[0])))

    @property
    def mean(self) -> "Likeness":
        """Return the mean along the first dimension."""
        return Likeness(*(each.mean(0) for each in vars(self).values()))

    def distances(self, pictures: "Likeness") -> dict[str, Tensor]:
        """Return how far pictures [P, S] are, at the scale of each at which it is nearest: by kind [P].

        A layer counts by the cosine, and with colours the Hellinger distance of histograms counts too.
        """
        shares = (self.histogram.sqrt() - pictures.histogram.sqrt()).norm(dim=-1)
        far = {
            name: by_layers(getattr(self, name), getattr(pictures, name)) for name in ("colors", "pattern")
        }
        far["colors"] = far["colors"] + HISTOGRAM * shares
        return {name: each.amin(dim=-1) for name, each in far.items()}


def by_layers(ours: Tensor, others: Tensor) -> Tensor:
    """Return the sum over layers of the cosine distances [...] of descriptions [..., C]."""
    pairs = zip(ours.chunk(len(LAYERS), -1), others.chunk(len(LAYERS), -1), strict=True)
    return torch.stack([1 - torch.cosine_similarity(a, b, dim=-1) for a, b in pairs]).sum(0)


@torch.no_grad()
def likeness(image: Tensor, where: Tensor, vgg: Vgg) -> Likeness:
    """Describe an image [3, h, w] in [0, 1] where it shows an object [h, w] bool, in one pixel at least."""
    own = image[:, where]
    whole = torch.where(where, image, own.mean(1)[:, None, None])
    red, green, blue = (BINS * own).long().clamp(0, BINS - 1)
    counts = torch.bincount((BINS * red + green) * BINS + blue, minlength=BINS**3)
    colors, pattern = (layer_statistics(each, where, vgg) for each in (whole, contrast(whole, where)))
    return Likeness(colors, pattern, counts / counts.sum())


def layer_statistics(image: Tensor, where: Tensor, vgg: Vgg) -> Tensor:
    """Return mean and deviation [C] of the features of each layer on the object."""
    parts = []
    for layer in vgg.layers(image[None], LAYERS):
        height, width = layer.shape[2:]
        share = F.adaptive_avg_pool2d(where[None].float(), (height, width))[0]
        counts = share > (MIN_COVERAGE if int((share > MIN_COVERAGE).sum()) >= MIN_FEATURES else 0)
        rows = layer[0][:, counts].float()
        parts.append(torch.cat([rows.mean(1), rows.std(1, correction=0)]))
    return torch.cat(parts)


def contrast(image: Tensor, where: Tensor) -> Tensor:
    """Return an image [3, h, w] in grey, around each pixel of the object with one mean and contrast."""
    height, width = where.shape
    sigma = CONTRAST_SIGMA * max(height, width)
    down, along = (smoothing(size, sigma).to(image) for size in (height, width))
    mask = where.to(image)
    grey = torch.einsum("chw,c->hw", image, image.new_tensor(LUMINANCE)) * mask
    share, mean, square = down @ torch.stack([mask, grey, grey.square()]) @ along
    share = share.clamp_min(1e-3)
    mean = mean / share
    deviation = (square / share - mean.square()).clamp_min(0).sqrt()
    return (0.5 + 0.2 * mask * (grey - mean) / (deviation + MIN_CONTRAST)).clamp(0, 1).expand(3, -1, -1)


def smoothing(size: int, sigma: float) -> Tensor:
    """Return the matrix [size, size] that smooths rows by a Gaussian; outside of them is nothing.

    With kernels as wide as here it takes a twentieth of the time of a convolution.
    """
    from kornia.filters import get_gaussian_kernel1d

    reach = round(3 * sigma)
    kernel = F.pad(get_gaussian_kernel1d(2 * reach + 1, sigma)[0], (size, size))
    at = torch.arange(size)
    return kernel[at - at[:, None] + reach + size]


def style_likeness(device: torch.device | str = "cpu") -> Likeness:
    """Return the descriptions [P, S] of all pictures of texgs."""
    tensors = load(LIKENESS_FILE.read_bytes())
    return Likeness(**{name: x.float().to(device) for name, x in tensors.items()})


@torch.no_grad()
def scene_likeness(scene: Scene, shown: Composed, vgg: Vgg) -> Likeness | None:
    """Describe framed views of a scene, which is opened, on a path of their own; None where nothing shows."""
    views = []
    for camera in spiral(VIEWS, scene.framed(shown).lens().square(SIZE)):
        view = shown.render(camera.to(shown.device), scene.light, scene.edits)
        where = view.alpha > min(0.5, 0.5 * float(view.alpha.max()))
        if bool(where.any()):
            views.append(likeness(view.color.clamp(0, 1).permute(2, 0, 1), where, vgg))
    return Likeness.stacked(views).mean if views else None
