"""How crisp images are: the mean gradient of their luminance on an object."""

from __future__ import annotations

from torch import Tensor

from texgs.core import check

LUMINANCE = (0.2126, 0.7152, 0.0722)  # of linear red, green and blue (ITU-R BT.709)
ON_OBJECT = 0.5  # of alpha, from which a pixel counts


def sharpness(image: Tensor, alpha: Tensor) -> float:
    """Mean length of the gradient of luminance per pixel on the object; NaN where alpha is high nowhere.

    Args:
        image: [H, W, 3].
        alpha: [H, W].

    Raises:
        ShapeError: if the sizes do not fit.
    """
    size = check.shape("image", image, "H W 3")
    check.shape("alpha", alpha, "H W", H=size["H"], W=size["W"])
    luminance = image @ image.new_tensor(LUMINANCE)
    down = luminance.diff(dim=0)[:, :-1]
    right = luminance.diff(dim=1)[:-1]
    inside = (alpha >= ON_OBJECT)[:-1, :-1]
    return float((down.square() + right.square()).sqrt()[inside].mean())
