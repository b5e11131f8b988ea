"""How well an edit fits its caption: similarity and directional similarity in CLIP's space."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError
from texgs.models.clip import Clip


@dataclass(frozen=True)
class ClipScores:
    """Means over views, in [-1, 1]; 1 is best."""

    backbone: str
    similarity: float
    direction: float


@torch.no_grad()
def clip_scores(
    clip: Clip, edited: Iterable[Tensor], originals: Iterable[Tensor], source: str, target: str
) -> ClipScores:
    """Score the views of an edited scene as InstructPix2Pix does (Brooks et al. 2023), averaged over views.

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
    similar, along = similarity(now, captions[1]), direction(then, now, *captions)
    return ClipScores(clip.name, similar.mean().item(), along.mean().item())


def similarity(images: Tensor, text: Tensor) -> Tensor:
    """Return the cosines [V] between features of images [V, D] and of a text [D]; differentiable."""
    size = check.shape("images", images, "V D")["D"]
    check.shape("text", text, "D", D=size)
    return torch.cosine_similarity(images, text[None], dim=1)


def direction(originals: Tensor, edited: Tensor, source: Tensor, target: Tensor) -> Tensor:
    """Return the cosines [V] between what changed in images and in captions; differentiable.

    cos(f(edited) - f(original), g(target) - g(source)) with unit features f [V, D] of views and g [D] of
    captions. An edit that changes nothing scores 0.
    """
    sizes = check.shape("originals", originals, "V D")
    check.shape("edited", edited, "V D", **sizes)
    for name, caption in (("source", source), ("target", target)):
        check.shape(name, caption, "D", D=sizes["D"])
    return torch.cosine_similarity(edited - originals, (target - source)[None], dim=1)
