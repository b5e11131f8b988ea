"""What one call of the rasterizer works on, dense and checked, and how the native library sees it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from torch import Tensor

from texgs.raster import native
from texgs.raster.types import Options


class SurfelTensors(NamedTuple):
    """Everything that gradients are computed for, in the order of `texgs_gradients`."""

    means: Tensor  # [N, 3]
    quats: Tensor  # [N, 4]
    scales: Tensor  # [N, 2] of surfels, [N, 3] of 3D Gaussians
    opacities: Tensor  # [N]
    shift: Tensor | None = None  # [N, 2]
    features: Tensor | None = None  # [N, C], or [N, C - 3] beside a texture:
    base: Tensor | None = None  # [N, 3]
    gain: Tensor | None = None  # [N]
    texels: Tensor | None = None  # [T, 3]

    @property
    def channels(self) -> int:
        """Channels C of the colour: those of the texture, then those of the features."""
        plain = 0 if self.features is None else self.features.shape[1]
        return plain if self.base is None else 3 + plain


@dataclass(frozen=True)
class View:
    """What does not take part in differentiation: camera, options, texture layout, wanted outputs."""

    viewmat: Tensor  # [4, 4]
    K: Tensor  # [3, 3]
    width: int
    height: int
    background: Tensor | None  # [C]
    sizes: Tensor | None  # [N, 2] of the texture
    offsets: Tensor | None  # [N]
    outputs: frozenset[str]
    options: Options

    def structures(
        self, surfels: SurfelTensors
    ) -> tuple[native.Surfels, native.Camera, native.RenderOptions]:
        """Surfels, camera and options as the library takes them."""
        o = self.options
        scene = native.Surfels(
            n=len(surfels.means),
            axes=surfels.scales.shape[1],
            channels=surfels.channels,
            sizes=native.address(self.sizes),
            offsets=native.address(self.offsets),
            n_texels=0 if surfels.texels is None else len(surfels.texels),
            **{name: native.address(x) for name, x in surfels._asdict().items()},
        )
        camera = native.Camera(native.address(self.viewmat), native.address(self.K), self.width, self.height)
        options = native.RenderOptions(
            native.address(self.background),
            min(o.low_pass, 1e30),  # infinite: no filter; the library multiplies it by 0 at the centre
            o.filter_sigma,
            o.dilation,
            o.antialiased,
            o.alpha_min,
            o.transmittance_min,
            o.near,
            min(o.far, 1e30),  # infinite: far / (far - near) is 1
        )
        return scene, camera, options
