"""Pictures and pages of scenes as notebooks show them."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from PIL.Image import Image

MB = 1e6
HEIGHT = 560  # of a page in a cell, pixels


class Page:
    """What a cell shows of a scene: a page to orbit and edit, and a picture where no page may run.

    The page is in the notebook itself: it needs no server, no network and no texgs.

    Args:
        text: of the page; nothing where it is too large.
        poster: a picture of it, JPEG.
        note: what stands below.
        height: of the page in the cell, pixels.
    """

    def __init__(self, text: str, poster: bytes, note: str, height: int = HEIGHT) -> None:
        self.text, self.poster, self.note, self.height = text, poster, note, height

    def _repr_mimebundle_(self, **_: Any) -> dict[str, Any]:
        """Return the page and the picture; a notebook that does not trust pages shows the picture."""
        picture = b64encode(self.poster).decode()
        if self.text:
            shown = frame_of_page(f'srcdoc="{escape(self.text)}"', self.height)
        else:
            shown = f'<img src="data:image/jpeg;base64,{picture}">'
        return {
            "text/html": f"{shown}<div><small>{escape(self.note)}</small></div>",
            "image/jpeg": picture,
            "text/plain": self.note,
        }


class LivePage:
    """A frame around the viewer, for a notebook on this machine."""

    def __init__(self, address: str, height: int = HEIGHT) -> None:
        self.address, self.height = address, height

    def _repr_html_(self) -> str:
        """Return the frame."""
        return frame_of_page(f'src="{escape(self.address)}"', self.height)


def frame_of_page(source: str, height: int) -> str:
    """Return the element that shows a page of `src="..."` or `srcdoc="..."`."""
    style = f"width:100%;height:{height}px;border:0"
    return f'<iframe {source} style="{style}" allowfullscreen></iframe>'


def picture_of(pixels: np.ndarray) -> Image:
    """Return pixels [H, W, 3 or 4], uint8, as an image of Pillow, which notebooks show."""
    from PIL.Image import fromarray

    return fromarray(pixels)


def as_python(value: Any) -> Any:
    """Return numbers and arrays of NumPy as those of Python, also in a list; all else as it is."""
    if isinstance(value, list | tuple):
        return [as_python(each) for each in value]
    return value.tolist() if hasattr(value, "tolist") else value


def inline(picture: Image, alt: str) -> str:
    """Return an element of HTML that holds a picture."""
    file = BytesIO()
    picture.save(file, "PNG")
    data = b64encode(file.getvalue()).decode()
    return f'<img alt="{escape(alt)}" src="data:image/png;base64,{data}">'
