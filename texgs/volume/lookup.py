"""What a volume says at points: its value and gradient there, and the colour of a transfer function."""

from collections.abc import Collection

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.raster import native
from texgs.raster.arguments import require
from texgs.volume.caster import Caster, NativeTransfer, NativeVolume, points_of
from texgs.volume.transfer import TransferFunction

COLUMNS = {"values": (), "gradients": (3,), "quats": (4,), "colors": (3,)}
NativeLookup = native.struct("texgs_lookup", f"p {' '.join(COLUMNS)}")
native.declare("texgs_volume_lookup", NativeVolume, NativeTransfer, "n p", NativeLookup)


class Lookup:
    """Looks points up in the volume of a caster, on its device. The same bits for any number of threads."""

    def __init__(self, caster: Caster, tf: TransferFunction) -> None:
        self._device, (self._volume, _) = caster.device, caster.channel(tf.channel)
        points = points_of(tf.in_support()).to(self._device)
        self._transfer = NativeTransfer(len(points), points)

    def at(self, points: Tensor, outputs: Collection[str]) -> dict[str, Tensor]:
        """Return some of COLUMNS at points [N, 3] in world units, float32, without gradients of autograd.

        `values` [N] are trilinear, in data values, and NaN beside missing samples; `gradients` [N, 3] are
        central differences, one voxel to both sides, per world unit; `quats` [N, 4] wxyz turn the z axis to
        them on the shortest way, and do nothing where there is no gradient; `colors` [N, 3] are those of the
        value, or of the nearest one that the function shows. Points beyond the volume are as those on its
        faces.
        """
        if unknown := {*outputs} - {*COLUMNS}:
            raise ArgumentError(f"outputs: expected some of {', '.join(COLUMNS)}, got {', '.join(unknown)}")
        require({"points": (points, "N 3")})
        points = points.detach().to(self._device).contiguous()
        found = {name: torch.empty(len(points), *COLUMNS[name], device=self._device) for name in outputs}
        arguments = self._volume, self._transfer, len(points), points, NativeLookup(**found)
        native.call("texgs_volume_lookup", *arguments, device=self._device)
        return found
