"""A view of a scene beside its volume: both, their difference, and how close they are."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from texgs.core.figures import CELL, DPI, Cell, Row, Scale, as_picture, lay_out
from texgs.metrics.quality import compare
from texgs.raster import Render
from texgs.report.fit_figure import DIVERGING, MAGNIFIED, signed_error


def pictures(image: Render, truth: Render, gain: float = MAGNIFIED) -> dict[str, np.ndarray]:
    """Return scene, volume and error [H, W, 3] in [0, 1] by these names.

    The error is that of the worst channel, enlarged by the gain: red where the scene is too bright, blue
    where it is too dark.
    """
    error = scale_of(gain)(signed_error(image.color, truth.color))
    planes = {"scene": image.color, "volume": truth.color, "error": error}
    return {name: plane.cpu().clamp(0, 1).numpy() for name, plane in planes.items()}


def scale_of(gain: float) -> Scale:
    """Return which colours stand for which errors."""
    return Scale(-1 / gain, 1 / gain, DIVERGING)


def beside_volume(image: Render, truth: Render, gain: float) -> tuple[np.ndarray, dict[str, float]]:
    """Return `pictures` in a row [H, W, 3], uint8, and the scores of `compare`, which stand below.

    The pictures keep their pixels unless they are small.
    """
    scores, shown = compare(image, truth), pictures(image, truth, gain)
    words = dict(zip(("scene", "volume"), in_words(scores), strict=True))
    cells = [Cell(name, shown[name], text) for name, text in words.items()]
    cells.append(Cell(f"error × {gain:g}", shown["error"], scale=scale_of(gain)))
    figure = lay_out([Row("", cells)])
    figure.set_dpi(max(DPI, image.color.shape[1] / CELL))
    return np.asarray(as_picture(figure).convert("RGB")), scores


def in_words(scores: Mapping[str, float]) -> tuple[str, str]:
    """Return the scores of `compare`: of the whole picture, and on the object, if there is one."""
    whole = "PSNR {psnr:.2f} dB, SSIM {ssim:.4f}".format(**scores)
    if "object_psnr" not in scores:
        return whole, "no object in view"
    return whole, "object: {object_psnr:.2f} dB, SSIM {object_ssim:.4f}".format(**scores)
