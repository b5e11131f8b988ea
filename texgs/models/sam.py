"""Masks from clicks by Segment Anything (Kirillov et al. 2023), from its files or a transformers folder."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core.errors import ArgumentError
from texgs.models.masks import GrabCut, MaskModel, Pixels, Remembered, check_clicks
from texgs.models.networks import fast_dtype, read_folder, read_tensors
from texgs.models.weights import locate

MEAN = (123.675 / 255, 116.28 / 255, 103.53 / 255)  # per channel, of the encoder's training images
DEVIATION = (58.395 / 255, 57.12 / 255, 57.375 / 255)
NEARLY = 0.1  # masks whose qualities differ by less are equally good
PUBLISHED_NETWORKS = {  # title, and architecture in kornia, by name in the catalogue
    "mobile_sam": ("MobileSAM", "mobile_sam"),  # Zhang et al. 2023
    "sam_vit_h": ("SAM ViT-H", "vit_h"),  # the paper's
}

Encode = Callable[[Tensor], Tensor]  # [1, 3, S, S] to features of the image
Masks = tuple[Tensor, Tensor]
Decode = Callable[[Tensor, Tensor, Tensor, Tensor | None, bool], Masks]
"""Features, points [1, P, 2], labels [1, P], a box [1, 4] and whether there may be several masks, to logits
[K, L, L] and the quality [K] that the model expects of each."""


class Sam:
    """A mask model; the features of an image are computed once for all clicks on it.

    One click is ambiguous (a wheel, or the car): the model offers three masks for it, see `best_of`. For
    several clicks, or the box around an outline, it gives one mask. The encoder takes square images of so
    many pixels a side.
    """

    def __init__(
        self, name: str, encode: Encode, decode: Decode, size: int, device: torch.device | str = "cpu"
    ) -> None:
        self.name, self.size, self.device = name, size, torch.device(device)
        self._decode = decode
        self._features = Remembered(lambda image: encode(self.prepared(image)))

    def prepared(self, image: Tensor) -> Tensor:
        """Convert an image [H, W, 3] to the encoder's input [1, 3, S, S], zero-padded below or right."""
        from kornia.enhance import normalize

        planes = image.to(self.device).float().permute(2, 0, 1)[None]
        height, width = self.fitted(image.shape[0], image.shape[1])
        planes = F.interpolate(planes, (height, width), mode="bilinear", antialias=True)
        planes = normalize(planes, torch.tensor(MEAN), torch.tensor(DEVIATION))
        return F.pad(planes, (0, self.size - width, 0, self.size - height))

    def fitted(self, height: int, width: int) -> tuple[int, int]:
        """Return the size of an image scaled to fill the encoder's square."""
        scale = self.size / max(height, width)
        return max(int(height * scale + 0.5), 1), max(int(width * scale + 0.5), 1)

    @torch.no_grad()
    def __call__(
        self, image: Tensor, points: Tensor, positive: Tensor, held: Pixels = None, shown: Pixels = None
    ) -> Tensor:
        """Return the object [H, W] bool in an image, on the image's device; see `MaskModel`."""
        check_clicks(image, points, positive, held)
        shape = (image.shape[0], image.shape[1])
        height, width = self.fitted(*shape)
        scale = points.new_tensor([width / shape[1], height / shape[0]])
        places = (points * scale - 0.5).to(self.device)[None]  # the models count from centres of pixels
        labels = positive.to(self.device).long()[None]
        box, several = None, len(points) == 1 and held is None
        if held is not None:
            at = held.nonzero().flip(1)
            box = (torch.stack([at.amin(0), at.amax(0) + 1]) * scale - 0.5).to(self.device).reshape(1, 4)
        logits, quality = self._decode(self._features(image), places, labels, box, several)
        square = F.interpolate(logits[None].float(), (self.size, self.size), mode="bilinear")
        masks = F.interpolate(square[..., :height, :width], shape, mode="bilinear")[0] > 0
        return best_of(masks.to(image.device), quality.to(image.device), points.long(), shown)


def best_of(masks: Tensor, quality: Tensor, points: Tensor, shown: Pixels = None) -> Tensor:
    """Return the smallest of masks [K, H, W] bool that are nearly as good as the best, [H, W].

    A mask is as good as the model thinks, quality [K], times the share of it on what is shown; it has to hold
    the first of the points [P, 2], where one does.
    """
    on_it = masks if shown is None else masks & shown
    sizes = on_it.sum(dim=(1, 2))
    scores = quality * sizes / masks.sum(dim=(1, 2)).clamp_min(1)
    if len(points):
        holds = on_it[:, points[0, 1], points[0, 0]]
        scores = torch.where(holds | ~holds.any(), scores, -torch.inf)
    return masks[torch.where(scores >= scores.max() - NEARLY, sizes, masks[0].numel() + 1).argmin()]


def published_sam(
    name: str,
    path: str | Path | None = None,
    device: torch.device | str = "cpu",
    dtype: torch.dtype | None = None,
) -> Sam:
    """Return a SAM of `PUBLISHED_NETWORKS` from its authors' file, by default from a known place.

    The dtype, by default the fastest, is that of the encoder, which takes nearly all of the time.
    """
    from kornia.models.sam import Sam as Network
    from kornia.models.sam import SamConfig

    title, kind = PUBLISHED_NETWORKS[name]
    path = locate(name) if path is None else path
    dtype = fast_dtype(device) if dtype is None else dtype
    network = Network.from_config(SamConfig(kind)).eval().requires_grad_(False)
    try:
        network.load_state_dict(read_tensors(path))
    except RuntimeError as error:
        raise ArgumentError(f"{path}: expected the weights of {title}, got others") from error
    network.to(device)
    network.image_encoder.to(dtype)
    return Sam(title, *_kornia(network, dtype), network.image_encoder.img_size, device)


def _kornia(network: Any, dtype: torch.dtype) -> tuple[Encode, Decode]:
    """Wrap encoder and decoder of a kornia network."""

    def encode(pixels: Tensor) -> Tensor:
        features: Tensor = network.image_encoder(pixels.to(dtype)).float()
        return features

    def decode(features: Tensor, points: Tensor, labels: Tensor, box: Tensor | None, several: bool) -> Masks:
        sparse, dense = network.prompt_encoder((points, labels) if labels.numel() else None, box, None)
        places = network.prompt_encoder.get_dense_pe()
        logits, quality = network.mask_decoder(features, places, sparse, dense, several)
        return logits[0], quality[0]

    return encode, decode


def sam_folder(
    folder: str | Path, device: torch.device | str = "cpu", dtype: torch.dtype | None = None
) -> Sam:
    """Return a SAM of any size from a folder of transformers, such as a copy of facebook/sam-vit-base."""
    dtype = fast_dtype(device) if dtype is None else dtype
    (model,) = read_folder(folder, "sam", ("SamModel",))
    model.to(device)
    model.vision_encoder.to(dtype)
    return Sam(Path(folder).name, *_transformers(model, dtype), model.config.vision_config.image_size, device)


def _transformers(model: Any, dtype: torch.dtype) -> tuple[Encode, Decode]:
    """Wrap encoder and decoder of a transformers model."""

    def encode(pixels: Tensor) -> Tensor:
        features: Tensor = model.get_image_embeddings(pixels.to(dtype)).float()
        return features

    def decode(features: Tensor, points: Tensor, labels: Tensor, box: Tensor | None, several: bool) -> Masks:
        answer = model(
            image_embeddings=features,
            input_points=points[:, None] if labels.numel() else None,
            input_labels=labels[:, None] if labels.numel() else None,
            input_boxes=None if box is None else box[:, None],
            multimask_output=several,
        )
        return answer.pred_masks[0, 0], answer.iou_scores[0, 0]

    return encode, decode


def mask_model(name: str, device: torch.device) -> MaskModel:
    """Open the mask model of a name, or in a folder."""
    if name == "grabcut":
        return GrabCut()
    if name in PUBLISHED_NETWORKS:
        return published_sam(name, device=device)
    if not Path(name).is_dir():
        raise ArgumentError(
            f"masks: expected {', '.join(PUBLISHED_NETWORKS)}, grabcut or a folder with a SAM, got {name}"
        )
    return sam_folder(name, device)
