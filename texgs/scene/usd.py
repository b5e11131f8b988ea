"""OpenUSD files: a particle field for each model, with the kernel of surfels or of 3D Gaussians."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.io import write_bytes
from texgs.fields.ply_columns import Told
from texgs.fields.splats import REACH
from texgs.raster.shading import DEGREES
from texgs.scene.clouds import Cloud

METRES = {"mm": 1e-3, "um": 1e-6, "micrometer": 1e-6, "nm": 1e-9, "nanometer": 1e-9, "angstrom": 1e-10}
ATTRIBUTES = ("Position", "Orientation", "Scale", "Opacity", "SphericalHarmonics")  # each in its own schema


def write_usd(path: str | Path, clouds: Sequence[Cloud], told: Told = None) -> Path:
    """Create or replace a .usda or .usdc file in one step; clouds that are in a file's space name it.

    Below /Scene, with +y up and one metre for a world unit, each model is a prim with its name:
    `ParticleField` with the Gaussian surflet kernel, whose opacity is zero off the plane, or
    `ParticleField3DGaussianSplat`. Colours are as on a screen, in the space sRGB.
    Source: the schema usdVol of OpenUSD 26.03.

    Raises:
        ArgumentError: if usd-core is missing or older, or the file cannot be written.
    """
    try:
        from pxr import Gf, Usd, UsdGeom, Vt
        from pxr.UsdVol import ParticleField  # noqa: F401  absent before 26.03
    except ImportError as error:
        raise ArgumentError(
            f"{path}: expected usd-core 26.3 or newer, which is not installed; pip install '.[usd]'"
        ) from error
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    unit = told["unit"] if told and told["places"] == "space" else ""
    UsdGeom.SetStageMetersPerUnit(stage, METRES.get(str(unit), 1.0))
    said = {key: Vt.DoubleArray(x) if isinstance(x, list) else x for key, x in (told or {}).items()}
    stage.GetRootLayer().customLayerData = said
    root = UsdGeom.Xform.Define(stage, "/Scene").GetPrim()
    stage.SetDefaultPrim(root)
    Usd.ColorSpaceAPI.Apply(root).CreateColorSpaceNameAttr(Gf.ColorSpaceNames.SRGBRec709)
    for cloud in clouds:
        _define(root, cloud)
    with TemporaryDirectory() as folder:  # pxr recognises a format by the suffix
        file = Path(folder, f"scene{Path(path).suffix}")
        stage.GetRootLayer().Export(str(file))
        return write_bytes(path, file.read_bytes())


def _define(root: Any, cloud: Cloud) -> None:
    """Define the prim of a model: activated values, and quaternions xyzw, the order of USD in memory."""
    from pxr import Tf, Vt

    vectors = Vt.Vec3fArray.FromNumpy
    name = Tf.MakeValidIdentifier(cloud.name)
    while root.GetChild(name):
        name += "_"
    kind = "ParticleField" if cloud.is_flat else "ParticleField3DGaussianSplat"
    prim = root.GetStage().DefinePrim(root.GetPath().AppendChild(name), kind)
    prim.SetDisplayName(cloud.name)
    if cloud.is_flat:  # the other prim includes all its schemas
        for schema in ("KernelGaussianSurflet", *(f"{each}Attribute" for each in ATTRIBUTES)):
            prim.AddAppliedSchema(f"ParticleField{schema}API")
    reach = REACH * cloud.scales.max(axis=1, keepdims=True)
    extent = np.stack([(cloud.means - reach).min(axis=0), (cloud.means + reach).max(axis=0)])
    values = {
        "positions": vectors(cloud.means),
        "orientations": Vt.QuatfArray.FromNumpy(np.roll(cloud.quats, -1, axis=1)),
        "scales": vectors(cloud.scales),
        "opacities": Vt.FloatArray.FromNumpy(cloud.opacities),
        "radiance:sphericalHarmonicsDegree": DEGREES[cloud.sh.shape[1]],
        "radiance:sphericalHarmonicsCoefficients": vectors(cloud.sh.reshape(-1, 3)),
        "extent": vectors(extent),
    }
    for attribute, value in values.items():
        prim.GetAttribute(attribute).Set(value)
