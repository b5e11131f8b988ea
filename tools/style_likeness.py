"""Describe the style pictures of texgs for the metric `retrieval`: `python -m tools.style_likeness`.

Needs the weights of VGG-16, see `texgs.metrics.retrieval`.
"""

from pathlib import Path

import torch
from safetensors.torch import save_file
from torch import Tensor
from torch.nn import functional as F

from texgs.metrics.retrieval import LAYERS, LIKENESS_FILE, SCALES, SIZE, Likeness, likeness
from texgs.models.pictures import PICTURES, picture
from texgs.models.vgg import Vgg


@torch.no_grad()
def picture_likeness(image: Tensor, vgg: Vgg) -> Likeness:
    """Describe a picture [3, h, w] in [0, 1] at each of `SCALES`, [S] of them."""
    height, width = image.shape[1:]
    scaled = []
    for scale in SCALES:
        factor = scale * SIZE / max(height, width)
        size = [max(16, round(factor * side)) for side in (height, width)]
        small = F.interpolate(image[None], size, mode="bicubic", antialias=True)[0].clamp(0, 1)
        scaled.append(likeness(small, torch.ones(size, dtype=torch.bool, device=image.device), vgg))
    return Likeness.stacked(scaled)


def write_known(vgg: Vgg) -> Path:
    """Describe all pictures of texgs in the file that the metric `retrieval` reads; return the file."""
    described = Likeness.stacked(picture_likeness(picture(name), vgg) for name in PICTURES)
    file = Path(str(LIKENESS_FILE))
    save_file({name: x.half().contiguous() for name, x in vars(described).items()}, file)
    return file


if __name__ == "__main__":
    print(write_known(Vgg.load(layers=LAYERS)))
