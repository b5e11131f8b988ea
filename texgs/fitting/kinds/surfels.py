"""The fit of surfels: spherical harmonics, then Blinn-Phong shading, then texels; each phase is a stage."""

from texgs.fields.kinds.surfels import FIELD
from texgs.fitting.kinds import FitSpec

FIT: FitSpec[None] = FitSpec(FIELD, "textured 2D Gaussians", phases=("surfels", "shading", "texture"))
