"""A view of a scene beside its volume: both, their difference, and how close they are."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from texgs.core.figures import CELL, DPI, Cell, Row, Scale, as_picture, lay_out
from texgs.metrics.quality import compare
from texgs.raster import Render
from texgs.report.fit_figure import DIVERGING, signed_error


def beside_volume(image: Render, truth: Render, gain: float) -> tuple[np.ndarray, dict[str, float]]:
    """Return scene, volume and difference in a row [H, W, 3], uint8, and the scores of `compare`.

    The difference is that of the worst channel, enlarged by the gain: red where the scene is too bright, blue
    where it is too dark. The pictures keep their pixels unless they are small.
    """
    scores, scale = compare(image, truth), Scale(-1 / gain, 1 / gain, DIVERGING)
    error = scale(signed_error(image.color, truth.color))
    seen, expected = (each.color.cpu().clamp(0, 1).numpy() for each in (image, truth))
    whole, on_object = in_words(scores)
    cells = [Cell("scene", seen, whole), Cell("volume", expected, on_object)]
    cells.append(Cell(f"difference × {gain:g}", error, scale=scale))
    figure = lay_out([Row("", cells)])
    figure.set_dpi(max(DPI, seen.shape[1] / CELL))
    return np.asarray(as_picture(figure).convert("RGB")), scores


def in_words(scores: Mapping[str, float]) -> tuple[str, str]:
    """Return the scores of `compare`: of the whole picture, and on the object, if there is one."""
    whole = "PSNR {psnr:.2f} dB, SSIM {ssim:.4f}".format(**scores)
    if "object_psnr" not in scores:
        return whole, "no object in view"
    return whole, "object: {object_psnr:.2f} dB, SSIM {object_ssim:.4f}".format(**scores)
