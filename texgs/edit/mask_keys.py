"""Keys of segments: the mask model, and how its masks select surfels."""

from dataclasses import dataclass

from texgs.core.keys import key

MASKS = ("mobile_sam", "sam_vit_h", "grabcut")  # the second is the paper's


@dataclass(frozen=True)
class MaskKeys:
    """How masks are found in views around the object, and how they select surfels."""

    masks: str = key(
        "mobile_sam",
        "what finds the object: mobile_sam, sam_vit_h, a folder with a SAM of transformers, or grabcut, "
        "which needs no weights",
    )
    vote: str = key(
        "contribution",
        "how masks become surfels; centre: as in the paper",
        choices=("contribution", "centre"),
    )
    connected: bool = key(False, "only the connected pieces that hold a click are kept")
    views: int = key(42, "number of views that vote, 10 f^2 + 2: 12, 42, 92, 162, ...", least=12)
    size: int = key(512, "side of these views", "pixels", least=32)


def mask_weights(masks: str) -> dict[str, str]:
    """Return the weights of a mask model, for `Method.weights`."""
    return {} if masks == "grabcut" else {masks: "masks=grabcut"}
