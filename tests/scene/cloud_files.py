"""Readers of exported clouds, for comparison: what other programs would make of the files, and draw."""

import gzip
import json
import struct
from dataclasses import replace
from itertools import pairwise

import numpy as np
import torch
from pxr import Usd, UsdVol

from texgs.fields.surfels.shading import ShadingModel
from texgs.raster import Options, rasterize
from texgs.raster.shading import DEGREES, spherical_harmonics
from texgs.scene.clouds import Cloud

EXTENSION = "KHR_gaussian_splatting"


def read_usd(path):
    """Return a cloud of each particle field."""
    stage = Usd.Stage.Open(str(path))
    return [_field(prim) for prim in stage.Traverse() if prim.IsA(UsdVol.ParticleField)]


def _field(prim):
    def read(name):
        return np.array(prim.GetAttribute(name).Get())

    quats = [[q.GetReal(), *q.GetImaginary()] for q in prim.GetAttribute("orientations").Get()]
    degree = prim.GetAttribute("radiance:sphericalHarmonicsDegree").Get()
    sh = read("radiance:sphericalHarmonicsCoefficients").reshape(-1, (degree + 1) ** 2, 3)
    is_flat = prim.HasAPI(UsdVol.ParticleFieldKernelGaussianSurfletAPI)
    assert is_flat != prim.HasAPI(UsdVol.ParticleFieldKernelGaussianEllipsoidAPI)
    values = (read("positions"), np.array(quats, np.float32), read("scales"), read("opacities"), sh)
    return Cloud(prim.GetDisplayName(), is_flat, is_flat, *values)


def glb(path):
    """Return the description and the data of a GLB file."""
    data = path.read_bytes()
    magic, version, length, n, kind = struct.unpack_from("<4sIII4s", data)
    assert (magic, version, length, kind, n % 4) == (b"glTF", 2, len(data), b"JSON", 0)
    n_bytes, kind = struct.unpack_from("<I4s", data, 20 + n)
    assert (n_bytes, kind) == (length - 28 - n, b"BIN\0")
    return json.loads(data[20 : 20 + n]), data[28 + n :]


def read_gltf(path):
    """Return a cloud of each node, whose attributes must be those that the extension requires."""
    description, data = glb(path)

    def read(index):
        accessor = description["accessors"][index]
        view = description["bufferViews"][accessor["bufferView"]]
        columns = {"SCALAR": (), "VEC3": (3,), "VEC4": (4,)}[accessor["type"]]
        end = view["byteOffset"] + view["byteLength"]
        values = np.frombuffer(data[view["byteOffset"] : end], "<f4")
        return values.reshape(accessor["count"], *columns)

    clouds = []
    for node in description["nodes"]:
        (primitive,) = description["meshes"][node["mesh"]]["primitives"]
        own = {name: read(index) for name, index in primitive["attributes"].items()}
        names = sorted(name for name in own if name.startswith(f"{EXTENSION}:SH_DEGREE_"))
        sh = np.stack([own[name] for name in names], axis=1)
        values = [own[f"{EXTENSION}:{name}"] for name in ("ROTATION", "SCALE", "OPACITY")]
        quats = values.pop(0)[:, [3, 0, 1, 2]]
        clouds.append(Cloud(node["name"], False, False, own["POSITION"], quats, *values, sh))
    return clouds


def read_spz(path):
    """Return the one cloud, read splat by splat as Niantic's README and load-spz.cc describe them."""
    data = gzip.decompress(path.read_bytes())
    magic, version, n, degree, fraction, flags, _ = struct.unpack_from("<4sIIBBBB", data)
    assert (magic, version) == (b"NGSP", 3)
    rest = 3 * ((degree + 1) ** 2 - 1)
    at = np.cumsum([16, 9 * n, n, 3 * n, 3 * n, 4 * n, rest * n])
    assert at[-1] == len(data)
    means, alphas, colors, scales, quats, sh = (data[a:b] for a, b in pairwise(at))
    whole = [int.from_bytes(means[k : k + 3], "little", signed=True) for k in range(0, len(means), 3)]

    def numbers(packed, columns):
        return np.frombuffer(packed, np.uint8).astype(np.float32).reshape(n, *columns)

    constant = (numbers(colors, (1, 3)) / 255 - 0.5) / 0.15
    harmonics = np.concatenate([constant, numbers(sh, (rest // 3, 3)) / 128 - 1], axis=1)
    return [
        Cloud(
            "spz",
            False,
            bool(flags & 1),
            np.array(whole, np.float32).reshape(n, 3) / 2**fraction,
            np.array([_quaternion(*struct.unpack_from("<I", quats, 4 * k)) for k in range(n)], np.float32),
            np.exp(numbers(scales, (3,)) / 16 - 10),
            numbers(alphas, ()) / 255,
            harmonics,
        )
    ]


def _quaternion(packed):
    """Unpack the last of the three small components first; return wxyz."""
    xyzw, largest = [0.0] * 4, packed >> 30
    for index in reversed([k for k in range(4) if k != largest]):
        xyzw[index] = (packed & 511) / 511 / 2**0.5 * (-1 if packed >> 9 & 1 else 1)
        packed >>= 10
    xyzw[largest] = (1 - sum(x * x for x in xyzw)) ** 0.5
    return [xyzw[3], *xyzw[:3]]


READERS = {".usda": read_usd, ".usdc": read_usd, ".glb": read_gltf, ".spz": read_spz}


def joined(clouds):
    """Return one cloud of all, as renderers sort them together."""
    names = ("means", "quats", "scales", "opacities", "sh")
    arrays = {name: np.concatenate([getattr(cloud, name) for cloud in clouds]) for name in names}
    return replace(clouds[0], **arrays)


def drawn(clouds, camera, background):
    """Return the picture [H, W, 3] of clouds: surfels with the filter of fits, others with that of 3DGS."""
    cloud = joined(clouds)
    options = ShadingModel().options if cloud.is_flat else Options(antialiased=cloud.antialiased)
    assert cloud.sh.shape[1] in DEGREES
    means, quats, scales, opacities, sh = (
        torch.tensor(x) for x in (cloud.means, cloud.quats, cloud.scales, cloud.opacities, cloud.sh)
    )
    render = rasterize(
        *(means, quats, scales[:, :2] if cloud.is_flat else scales, opacities),
        *(camera.viewmat, camera.K, camera.width, camera.height),
        features=spherical_harmonics(sh, means, camera.position),
        background=torch.tensor(background),
        options=options,
    )
    return render.color.clamp(0, 1)
