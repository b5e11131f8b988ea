"""Slices of a volume on the faces of cuts, which hide what is behind them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch.nn.functional import pad

from texgs.core.camera import Camera
from texgs.raster.api import CutRange
from texgs.volume.caster import Cast, Caster
from texgs.volume.lookup import Lookup
from texgs.volume.slices import Labels, slice_colors
from texgs.volume.transfer import TransferFunction

ROUNDING = 1e-5  # world units of places: the outermost slices are in the volume
ANY = TransferFunction(((0, 1), (1, 1)), ((0, 0, 0, 0),))  # only its channel is looked up


def with_slices(
    seen: Cast, camera: Camera, cut: CutRange, caster: Caster, window: Sequence[float], labels: Labels
) -> Cast:
    """Return a view with slices on the faces of a cut, opaque where a face is in the volume."""
    near, far = cut.depth_range
    places = camera.unproject(near)
    beyond = (places.abs() - places.new_tensor(caster.half)).amax(dim=-1)
    solid = (cut.face >= 0) & (near < far) & (beyond <= ROUNDING)

    def values(channel: int) -> np.ndarray:
        found = Lookup(caster, replace(ANY, channel=channel)).at(places[solid], ("values",))
        return found["values"].cpu().numpy()

    colors = torch.from_numpy(slice_colors(values, window, labels)).to(seen.rgba) / 255
    seen.rgba[solid] = pad(colors, (0, 1), value=1.0)
    depth, median = (x if x is None else torch.where(solid, near, x) for x in (seen.depth, seen.median))
    return Cast(seen.rgba, depth, median)
