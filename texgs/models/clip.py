"""Features of images and texts by CLIP (Radford et al. 2021), and how well an edit fits its caption."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core import check
from texgs.core.errors import ArgumentError
from texgs.models.networks import read_folder
from texgs.models.weights import locate, title_of

MEAN = (0.48145466, 0.4578275, 0.40821073)  # per channel, of CLIP's training images
DEVIATION = (0.26862954, 0.26130258, 0.27577711)


@dataclass(frozen=True, eq=False)
class Clip:
    """A frozen CLIP model; features are unit vectors in a space that images and texts share."""

    name: str  # of the backbone, for table headers
    network: Any
    tokenizer: Any

    @classmethod
    def load(cls, weights: str | Path, device: torch.device | str = "cpu") -> Self:
        """Read a model in float32, by a name of the catalogue or from a folder with its tokenizer."""
        folder = Path(weights) if Path(weights).is_dir() else locate(str(weights))
        network, tokenizer = read_folder(folder, "clip", ("CLIPModel", "AutoTokenizer"))
        name = folder.name if Path(weights).is_dir() else title_of(str(weights))
        return cls(name, network.to(device), tokenizer)

    @property
    def size(self) -> int:
        """Return the side of the encoder's square input, pixels."""
        return int(self.network.config.vision_config.image_size)

    def prepared(self, images: Tensor) -> Tensor:
        """Convert images [B, H, W, 3] in [0, 1] to the encoder's input [B, 3, S, S]; differentiable.

        The whole image is squeezed to a square by bicubic interpolation without antialiasing, nothing is cut
        off: as the metrics of InstructPix2Pix and Instruct-NeRF2NeRF do, unlike CLIP's own preprocessing.
        """
        from kornia.enhance import normalize

        check.shape("images", images, "B H W 3")
        planes = images.permute(0, 3, 1, 2)
        planes = F.interpolate(planes, (self.size, self.size), mode="bicubic", align_corners=False)
        prepared: Tensor = normalize(planes, torch.tensor(MEAN), torch.tensor(DEVIATION))
        return prepared

    def images(self, images: Tensor) -> Tensor:
        """Return features [B, D] of images [B, H, W, 3] in [0, 1]; differentiable in the images."""
        return self.encoded(self.prepared(images))

    def encoded(self, pixels: Tensor) -> Tensor:
        """Return features [B, D] of normalised input [B, 3, S, S]; differentiable."""
        device = next(self.network.parameters()).device
        return _unit(self.network.get_image_features(pixel_values=pixels.to(device)))

    @torch.no_grad()
    def texts(self, texts: Sequence[str]) -> Tensor:
        """Return features [T, D] of texts, truncated to the model's length."""
        if not texts or not all(text.strip() for text in texts):
            raise ArgumentError("texts: expected words in each, got an empty one; describe the picture")
        device = next(self.network.parameters()).device
        tokens = self.tokenizer(
            list(texts),
            padding=True,
            truncation=True,
            max_length=self.network.config.text_config.max_position_embeddings,
            return_tensors="pt",
        ).to(device)
        inputs = {name: tokens[name] for name in ("input_ids", "attention_mask")}
        return _unit(self.network.get_text_features(**inputs))


def _unit(features: Any) -> Tensor:
    """Return features [B, D] of unit length; newer versions of transformers wrap them."""
    pooled: Tensor = features if isinstance(features, Tensor) else features.pooler_output
    return F.normalize(pooled, dim=-1)


@torch.no_grad()
def clip_scores(
    clip: Clip, edited: Iterable[Tensor], originals: Iterable[Tensor], source: str, target: str
) -> tuple[float, float]:
    """Return similarity and directional similarity of an edit, as InstructPix2Pix measures them.

    They are means over views in [-1, 1]; 1 is best (Brooks et al. 2023).

    Args:
        clip: the backbone; scores of different ones cannot be compared.
        edited: [H, W, 3] in [0, 1] of each view.
        originals: the same views of the scene before the edit.
        source: caption of the original, such as "a beetle"; a caption, not an instruction.
        target: caption of the edit, such as "a beetle made of gold".
    """
    captions = clip.texts([source, target])
    after = [clip.images(image[None])[0] for image in edited]
    before = [clip.images(image[None])[0] for image in originals]
    if not after or len(after) != len(before):
        raise ArgumentError(
            f"views: expected as many of the edited scene as of the original, got {len(after)} and "
            f"{len(before)}"
        )
    now, then = torch.stack(after), torch.stack(before)
    return similarity(now, captions[1]).mean().item(), direction(then, now, *captions).mean().item()


def similarity(images: Tensor, text: Tensor) -> Tensor:
    """Return the cosines [V] between features of images [V, D] and of a text [D]; differentiable."""
    size = check.shape("images", images, "V D")["D"]
    check.shape("text", text, "D", D=size)
    return torch.cosine_similarity(images, text[None], dim=1)


def direction(originals: Tensor, edited: Tensor, source: Tensor, target: Tensor) -> Tensor:
    """Return the cosines [V] between the changes of images and of captions; differentiable.

    cos(f(edited) - f(original), g(target) - g(source)) with unit features f [V, D] of views and g [D] of
    captions. An edit that changes nothing scores 0.
    """
    sizes = check.shape("originals", originals, "V D")
    check.shape("edited", edited, "V D", **sizes)
    for name, caption in (("source", source), ("target", target)):
        check.shape(name, caption, "D", D=sizes["D"])
    return torch.cosine_similarity(edited - originals, (target - source)[None], dim=1)
