"""Compact files of basic models: quantised texels, the rest in half precision, packed by xz."""

import json
import lzma
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.io import reading, write_bytes
from texgs.core.memory import require_memory
from texgs.core.ply_file import is_ply
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import describe, model_of, read_model
from texgs.fields.surfels.ply import read_ply
from texgs.fields.surfels.texels import mean_texels, offsets_of, owners, with_first_texels

FORMAT = "texgs-compact"
VERSION = 1
MAGIC = b'{"texgs-compact":'
TEXEL_STEP = 1 / 128  # unit of texels; errors stay below 1/256, a level of an 8-bit picture
MAX_STEPS = 2**23  # units of a texel that float32 holds exactly
TEXTURE_TENSORS = ("texels", "sizes", "offsets")
EXACT_TENSORS = (
    "means",
    "palette",
)  # half precision would move surfels by up to a tenth of a pixel at 800x800
MAX_HEADER_BYTES = 2**20  # bytes, of the tensors' names and shapes
COPIES = 6  # copies of the tensors in memory; texels are bytes in files, floats in models
MEMORY = 2**28  # bytes for unpacking besides its result; our files need 9 MiB


def write_compact(
    path: str | Path, model: Surfels, seen: Tensor | None = None, *, step: float = TEXEL_STEP
) -> Path:
    """Create or replace a compact model file in one step; the same model gives the same bytes.

    Means and palette stay exact, and so does a material that all surfels share. Texels are rounded to
    multiples of `step`, all else to half precision. Surfels that are not `seen` [N] bool get one texel, the
    mean of theirs; by default all are. The file is one line of JSON (what a model file has in its header) and
    then, packed by xz, which also finds damage, a safetensors file.
    """
    from safetensors.numpy import save

    header = {FORMAT: VERSION, "step": step, "model": describe(path, model)}
    if not 0 < step < 1:
        raise ArgumentError(f"step: expected a part of the colour range from 0 to 1, got {step}")
    model = model.to("cpu")
    if seen is not None:
        model = _without_unseen(model, seen.cpu())
    with errors_at(path):
        packed = lzma.compress(save(compact_tensors(model, step)), preset=6)
    return write_bytes(path, json.dumps(header, separators=(",", ":")).encode() + b"\n" + packed)


def read_compact(path: str | Path) -> Surfels:
    """Read a compact model file to the CPU. Nothing in it is executed."""
    from safetensors.numpy import load

    with reading(
        path, f"a whole {FORMAT} file", "it is cut short or damaged: copy or write it again"
    ) as path:
        line, _, packed = path.read_bytes().partition(b"\n")
        header = _header(path, line)
        parameters = _parameters(load(_unpacked(path, packed)), float(header["step"]))
    return model_of(path, header["model"], parameters)


def open_model(path: str | Path) -> Surfels:
    """Read a file of a model: lossless, compact or PLY, recognised by its first bytes."""
    path = Path(path)
    if is_ply(path):
        return read_ply(path)
    with suppress(OSError), path.open("rb") as file:  # the reader reports the error
        is_compact = file.read(len(MAGIC)) == MAGIC
        return read_compact(path) if is_compact else read_model(path)
    return read_model(path)


@torch.no_grad()
def seen_surfels(model: Surfels, cameras: Sequence[Camera]) -> Tensor:
    """Return which surfels [N] bool are blended into a pixel of any view.

    Edits that make a model more transparent can reveal others.
    """
    seen = torch.zeros_like(model.parameters["opacities"], dtype=torch.bool)
    for camera in cameras:
        statistics = model.render(camera.to(seen.device), outputs=("statistics",)).statistics
        seen |= statistics.pixels > 0  # type: ignore[union-attr]
    return seen


# -- writing ---


def compact_tensors(model: Surfels, step: float = TEXEL_STEP) -> dict[str, np.ndarray]:
    """Return the tensors of a compact file, see `write_compact`, of a model on the CPU."""
    stored = {
        name: _rounded(name, x.detach())
        for name, x in model.parameters.items()
        if name not in TEXTURE_TENSORS
    }
    if model.stage == "texture":
        stored |= _texture(model.parameters, step)
    return stored


def _without_unseen(model: Surfels, seen: Tensor) -> Surfels:
    """Give each unseen surfel one texel, the mean."""
    check.shape("seen", seen, "N", N=len(model))
    if seen.dtype != torch.bool:
        raise ArgumentError(f"seen: expected bool, got {seen.dtype}; compare it with a threshold")
    if model.stage != "texture":
        return model
    p, texels = model.parameters, model.parameters["texels"].clone()
    texels[p["offsets"][~seen]] = mean_texels(p)[~seen].to(texels)
    return with_first_texels(replace(model, parameters={**p, "texels": texels}), seen)


def _rounded(name: str, values: Tensor) -> np.ndarray:
    """Round values to half precision if its range holds them."""
    half = values.half()
    is_turn = name in ("quats", "normals")
    if is_turn and not torch.equal(half.float(), values):  # values from a compact file stay unchanged
        half = normalize(values, dim=1).half()  # the length does not matter, but half precision is coarse
    exact = name in EXACT_TENSORS or values.shape == (1,) or not bool(half.isfinite().all())
    return (values if exact else half).contiguous().numpy()


def _texture(p: Mapping[str, Tensor], step: float) -> dict[str, np.ndarray]:
    """Return sizes, and `codes` of texels in steps as green, red - green, blue - green: these are alike."""
    texels = p["texels"].detach()[owners(p)[0]]
    steps = (texels.double() / step).round()
    if bool((steps.abs() > MAX_STEPS).any()):
        raise ArgumentError(
            f"texels: expected at most {MAX_STEPS * step:g}, got {float(texels.abs().max()):g}; "
            "write a lossless model file"
        )
    red, green, blue = steps.int().T
    codes = codes_of(torch.stack([green, red - green, blue - green]))
    return {"codes": codes, "sizes": p["sizes"].detach().contiguous().numpy()}


def codes_of(whole: Tensor) -> np.ndarray:
    """Return int32 [C, N] as bytes [B, C, N] of numbers whose last bit is the sign, from low to high.

    All planes but the first are nearly all zero where numbers are small.
    """
    signed = whole << 1 ^ whole >> 31
    width = 1 + sum(bool((signed >> 8 * k).any()) for k in (1, 2, 3))
    return torch.stack([signed >> 8 * k & 255 for k in range(width)]).byte().numpy()


# -- reading ---


def _header(path: Path, line: bytes) -> dict[str, Any]:
    """Read the first line; check its version before the rest."""
    if not line.startswith(MAGIC):
        raise ArgumentError(f"{path}: expected a {FORMAT} file, got one of another format; read_model reads "
                            "lossless ones")  # fmt: skip
    try:
        header: dict[str, Any] = json.loads(line)
        version = int(str(header[FORMAT]))
        known = version > VERSION or 0 < float(header["step"]) < 1
    except (KeyError, RecursionError, TypeError, ValueError):
        version, known = 0, False
    if version > VERSION:
        raise ArgumentError(
            f"{path}: expected version {VERSION} of the format at most, got {version}; update texgs"
        )
    if not known or not isinstance(header.get("model"), dict):
        raise ArgumentError(f"{path}: expected version, step and model in its first line; write it again")
    return header


def _unpacked(path: Path, packed: bytes) -> bytes:
    """Unpack the safetensors file in an xz stream, no longer than its header says."""
    stream = lzma.LZMADecompressor(lzma.FORMAT_XZ, MEMORY)
    start = _taken(stream, 8, packed)
    header = _taken(stream, min(int.from_bytes(start, "little"), MAX_HEADER_BYTES))
    ends = [each["data_offsets"][1] for name, each in json.loads(header).items() if name != "__metadata__"]
    n_bytes = max(ends, default=0)
    what = f"{path}: a model of {n_bytes} bytes, as its header says,"
    require_memory(COPIES * n_bytes, what, "is it damaged?")
    tensors = _taken(stream, n_bytes)
    is_whole = len(tensors) == n_bytes and not _taken(stream, 1) and stream.eof  # where its checksum is
    if not is_whole or stream.unused_data:
        raise ValueError(f"{len(tensors)} bytes of tensors, expected {n_bytes}")
    return start + header + tensors


def _taken(stream: lzma.LZMADecompressor, count: int, packed: bytes = b"") -> bytes:
    """Take the next bytes of a stream, fewer at its end."""
    unpacked = b"" if stream.eof else stream.decompress(packed, count)
    while len(unpacked) < count and not stream.eof and not stream.needs_input:
        unpacked += stream.decompress(b"", count - len(unpacked))
    return unpacked


def _parameters(stored: dict[str, np.ndarray], step: float) -> dict[str, Tensor]:
    """Return float32 tensors of a model from the tensors of `write_compact`."""
    codes = stored.pop("codes", None)
    parameters = {name: torch.from_numpy(x.copy()) for name, x in stored.items()}
    if codes is not None:
        if codes.dtype != np.uint8:
            raise TypeError("codes")
        signed = torch.zeros(codes.shape[1:], dtype=torch.int32)  # [3, T]
        for k, plane in enumerate(codes):
            signed |= torch.from_numpy(plane.astype(np.int32) << 8 * k)
        green, red, blue = (signed >> 1) ^ -(signed & 1)
        texels = torch.stack([green + red, green, green + blue], dim=1) * step
        parameters |= {"texels": texels, "offsets": offsets_of(parameters["sizes"])}
    return {name: x.float() if x.dtype == torch.float16 else x for name, x in parameters.items()}
