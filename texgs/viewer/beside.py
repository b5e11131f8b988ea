"""A scene beside its volume, or where it names none, beside the training view nearest to the camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from texgs.core.cuts import NO_CUTS
from texgs.core.errors import ArgumentError
from texgs.core.figures import Scale
from texgs.metrics.quality import compare
from texgs.report.fit_figure import DIVERGING, signed_error
from texgs.scene.scene import Scene
from texgs.scene.session import Session
from texgs.viewer.messages import View
from texgs.viewer.origins import Origins, fitted, over


class Beside:
    """Shows what a scene is compared with, by how much it differs, or both with a line between them."""

    def __init__(self, session: Session, origins: Origins) -> None:
        self._session, self._origins = session, origins

    @property
    def modes(self) -> list[str]:
        """Return what there is to show of the session's scene."""
        if self._session.scene.volume is not None:
            return ["volume", "difference", "wipe"]
        return ["truth", "difference"] if self._origins.has_views else []

    def frame(self, view: View, scene: Scene, scale: float) -> tuple[np.ndarray, dict[str, float]]:
        """Return a frame [H, W, 3], uint8, and at rest how close scene and volume are in it.

        A training view is in the middle of the frame, has its own light, and knows no cuts.
        """
        camera = view.camera.camera(scale)
        if scene.volume is not None:
            image, truth = self._session.beside(camera, scene)
            return shown(view, image.color, truth.color), {} if view.moving else compare(image, truth)
        if view.mode == "wipe":
            raise ArgumentError("wipe: expected a scene that names its volume; make it by texgs compose")
        nearest = self._origins.nearest(camera, scene)
        plain = replace(scene, light=nearest.light, cuts=NO_CUTS)
        pair = (self._session.frame(nearest.camera, "shaded", plain), over(nearest, scene.background))
        seen, expected = (torch.from_numpy(each) / 255 for each in pair)
        return fitted(shown(view, seen, expected), camera.width, camera.height), {}


def shown(view: View, image: Tensor, truth: Tensor) -> np.ndarray:
    """Return what a view shows of two pictures [H, W, 3], uint8.

    A difference is that of the worst channel: red where the scene is too bright, blue where it is too dark.
    """
    picture, width = truth, image.shape[1]
    if view.mode == "difference":
        picture = Scale(-1 / view.gain, 1 / view.gain, DIVERGING)(signed_error(image, truth))
    elif view.mode == "wipe":
        left, right = (width, 0) if view.wipe is None else [round(view.wipe * width)] * 2
        picture = torch.cat([image[:, :left], truth[:, right:]], dim=1)
    return (picture.clamp(0, 1) * 255).round().to(torch.uint8).cpu().numpy()
