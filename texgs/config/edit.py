"""The schema of conf/edit: edits that give a scene a new look, by a picture, by words, or in a part of it."""

from dataclasses import dataclass
from typing import Any

from omegaconf import MISSING

from texgs.config.keys import key


@dataclass
class ImageEdit:
    """Image-driven: the style of a picture (the paper's section Image-Driven NPSE)."""

    style: str = key("strokes", "picture that texgs paints (strokes, glass, marble, ...), or a picture file")
    recipe: str = key(
        "default",
        "default; translucent, for scenes one looks into; patches, which needs no weights; preview; paper",
        choices=("default", "translucent", "patches", "preview", "paper"),
    )
    iterations: int | None = key(None, "views, one each; default the recipe's", least=0)
    lambda_s: float | None = key(
        None, "share of NNFM, the rest is CLIP; default the recipe's", least=0, most=1
    )
    pattern: float = key(1.0, "size of the style's pattern, against the views'", above=0)
    start: str | None = key(
        None,
        "colours at the start: the picture laid onto the surface, its mean, random pixels of it, or the "
        "model's own moved to its colours; default the recipe's",
        choices=("projected", "mean", "random", "transfer"),
    )
    textured: bool = key(True, "each texel learns, or each surfel one colour: the paper's ablation")
    region: list[Any] = key([], "clicks on the object of the picture that counts, as shares; default all")
    masks: str = key(
        "mobile_sam", "what finds that object; grabcut needs no weights", choices=("mobile_sam", "grabcut")
    )


@dataclass
class TextEdit:
    """Text-driven: what an instruction says (the paper's section Text-Driven NPSE)."""

    instruction: str = key("", "what to do, such as 'make it gold'")
    guidance: str = key(
        "instruct_pix2pix",
        "what edits the views: a diffusion model, or procedural filters with a vocabulary of their own",
        choices=("instruct_pix2pix", "filters"),
    )
    recipe: str = key(
        "default",
        "how texels follow: solved; as in the paper; or views edited again and again, its counterpart",
        choices=("default", "paper", "iterative"),
    )
    size: int = key(512, "longer side of the edited views", "pixels", least=64)
    text_scale: float = key(12.5, "guidance by the instruction, of the diffusion model", least=0)
    image_scale: float = key(1.25, "guidance by the views, of the diffusion model", least=0)
    negative: str | None = key(None, "what views should not show; default words for light and shadow")
    epipolar: bool = key(False, "views are edited together, along epipolar lines")


@dataclass
class SegmentEdit:
    """2D-lift-3D segmentation: clicks on one view of a model become a segment of it."""

    model: str = key("", "whose part it is; may be left out where there is one")
    name: str = key("part", "of the segment")
    view: list[float] = key([30.0, 20.0], "azimuth and polar angle of the view clicked on", "degrees")
    # OmegaConf takes no integers for list[list[float]].
    points: list[Any] = key([], "clicks on the part: right and down, as shares of the view's sides")
    others: list[Any] = key([], "clicks on what does not belong to it")
    masks: str = key(
        "mobile_sam",
        "what finds the part in a view; grabcut needs no weights",
        choices=("mobile_sam", "grabcut"),
    )
    vote: str = key(
        "contribution",
        "how masks become surfels; centre: as in the paper",
        choices=("contribution", "centre"),
    )
    connected: bool = key(False, "only the connected pieces that hold a click are kept")
    views: int = key(42, "that vote, 10 f^2 + 2", least=12)
    size: int = key(512, "of these views", "pixels", least=32)


@dataclass
class Edit:
    """One edit of a scene. It may start from the result of another one."""

    name: str = key(MISSING, "name, also of its folder; that of its file in conf/edit")
    kind: str = key("none", "what it is", choices=("none", "image", "text", "segment"))
    base: str | None = key(
        None, "edit whose scene this starts from, or a scene.yaml file; default the scene as fitted"
    )
    parts: list[str] = key(
        [], "MODEL/SEGMENT, or models without their segments, that get the new look; default all models"
    )
    seed: int = key(0, "random numbers")
    source_caption: str = key("", "the scene before, in words, for CLIP's metrics")
    target_caption: str = key("", "the scene afterwards, in words, for CLIP's metrics")
    image: ImageEdit = key(ImageEdit, "image-driven")
    text: TextEdit = key(TextEdit, "text-driven")
    segment: SegmentEdit = key(SegmentEdit, "segmentation")
