"""A view of a scene beside its volume or its fit: both pictures, their difference, and scores."""

from collections.abc import Mapping, Sequence

import numpy as np

from texgs.core.figures import CELL, DPI, Cell, Row, Scale, as_picture, lay_out
from texgs.metrics.quality import compare
from texgs.raster import Render
from texgs.report.fit_figure import DIVERGING, ERROR_GAIN, signed_error

KEPT_IMAGES = {
    "depth": "depth",
    "normal": "normal",
    "opacity": "alpha",
}  # images that new looks do not change, in a render


def pictures(image: Render, truth: Render, gain: float = ERROR_GAIN) -> dict[str, np.ndarray]:
    """Return scene, volume and error [H, W, 3] in [0, 1] by these names.

    The error is that of the worst channel, enlarged by the gain: red where the scene is too bright, blue
    where it is too dark.
    """
    error = scale_of(gain)(signed_error(image.color, truth.color))
    planes = {"scene": image.color, "volume": truth.color, "error": error}
    return {name: plane.cpu().clamp(0, 1).numpy() for name, plane in planes.items()}


def scale_of(gain: float) -> Scale:
    """Return the colour scale of errors."""
    return Scale(-1 / gain, 1 / gain, DIVERGING)


def side_by_side(
    image: Render, truth: Render, gain: float, titles: tuple[str, str] = ("scene", "volume")
) -> tuple[np.ndarray, dict[str, float]]:
    """Return `pictures` in a row [H, W, 3], uint8, and the scores of `compare`, which stand below.

    The pictures keep their pixels unless they are small.
    """
    scores, shown = compare(image, truth), pictures(image, truth, gain)
    both = (shown["scene"], shown["volume"])
    cells = [Cell(*each) for each in zip(titles, both, score_words(scores), strict=True)]
    cells.append(Cell(f"difference × {gain:g}", shown["error"], scale=scale_of(gain)))
    figure = lay_out([Row("", cells)])
    figure.set_dpi(max(DPI, image.color.shape[1] / CELL))
    return np.asarray(as_picture(figure).convert("RGB")), scores


def score_words(scores: Mapping[str, float]) -> tuple[str, str]:
    """Format the scores of `compare`: on the object, if any, and of the whole picture."""
    whole = "whole picture: {psnr:.2f} dB, SSIM {ssim:.4f}".format(**scores)
    if "object_psnr" not in scores:
        return "no object in view", whole
    return "PSNR on the object {object_psnr:.2f} dB, SSIM {object_ssim:.4f}".format(**scores), whole


def changes_of(image: Render, fitted: Render) -> dict[str, float]:
    """Return the largest difference of a colour, and numbers of pixels with other depth, normal, opacity."""
    told = {"colour": float((image.color - fitted.color).abs().max())}
    for title, name in KEPT_IMAGES.items():
        now, before = getattr(image, name), getattr(fitted, name)
        if now is not None and before is not None:
            told[title] = float((now != before).reshape(*image.alpha.shape, -1).any(dim=-1).sum())
    return told


def change_words(told: Sequence[Mapping[str, float]]) -> str:
    """Describe the changes of all views by edits; see `changes_of`."""
    total = {title: sum(view[title] for view in told) for title in KEPT_IMAGES if title in told[0]}
    kept = ", ".join(title for title, pixels in total.items() if not pixels)
    other = [f"{pixels:.0f} pixels have another {title}" for title, pixels in total.items() if pixels]
    words = [f"colours differ by {max(view['colour'] for view in told):.3f} at most", *other]
    return ", ".join(words) + (f"; {kept}: bit for bit as fitted" if kept else "")
