"""What methods share that follow a picture: which picture, and which object of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.config.keys import key
from texgs.core.errors import ArgumentError
from texgs.methods.shares import shares

if TYPE_CHECKING:
    from texgs.edit.style_picture import StylePicture


@dataclass
class StyleKeys:
    """The picture, and the object of it that counts."""

    style: str = key("strokes", "picture that texgs paints (strokes, glass, marble, ...), or a picture file")
    region: list[Any] = key([], "clicks on the object of the picture that counts, as shares; default all")
    masks: str = key(
        "mobile_sam", "what finds that object; grabcut needs no weights", choices=("mobile_sam", "grabcut")
    )


def files(settings: StyleKeys) -> dict[str, Path]:
    """The picture's file, where it is one."""
    path = Path(settings.style)
    return {"style": path} if path.is_file() else {}


def weights(settings: StyleKeys) -> dict[str, bool]:
    """What finds the object, where that needs weights."""
    return {"mobile_sam": True} if settings.region and settings.masks == "mobile_sam" else {}


def picture_of(name: str, where: str) -> StylePicture:
    """The picture of texgs that has this name, or of a file; `where` are its keys, such as edit.image.

    Raises:
        ArgumentError: if there is neither, or the file holds no picture that can be used.
    """
    from texgs.edit.pictures import PICTURES, picture
    from texgs.edit.style_picture import StylePicture, read_style

    if name in PICTURES:
        return StylePicture.of(picture(name))
    if not Path(name).exists():
        raise ArgumentError(
            f"{where}.style: expected the file of a picture, or one of {', '.join(PICTURES)}; got {name!r}"
        )
    return read_style(name)


def check(settings: StyleKeys, where: str) -> None:
    """Require a picture that is there, and clicks on it.

    Raises:
        ArgumentError: naming the key.
    """
    from texgs.edit.pictures import PICTURES

    if settings.style not in PICTURES:
        picture_of(settings.style, where)
    shares(f"{where}.region", settings.region)


def style_of(settings: StyleKeys, where: str) -> StylePicture:
    """The picture, of it the object that was clicked on.

    Raises:
        ArgumentError, MissingDataError: as `check`, or if weights are missing.
    """
    import torch

    from texgs.edit.style_picture import StylePicture
    from texgs.models.by_name import mask_model

    style = picture_of(settings.style, where)
    if not settings.region:
        return style
    height, width = style.region.shape
    points = torch.tensor(shares(f"{where}.region", settings.region)) * torch.tensor([width, height])
    positive = torch.ones(len(points), dtype=torch.bool)
    masks = mask_model(settings.masks, torch.device("cpu"))
    return StylePicture.of(style.image, masks(style.image.permute(1, 2, 0), points, positive) & style.region)
