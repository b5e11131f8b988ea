"""The native libraries: found, opened and described to ctypes; calls with errors turned into exceptions.

`libtexgs` works on CPU tensors, `libtexgs_cuda` on CUDA tensors; both export the functions of `csrc/texgs.h` and
`csrc/texgs_losses.h`. They know raw pointers only, so that one build serves every version of torch and Python.
"""

from __future__ import annotations

import ctypes
import sys
from ctypes import POINTER, Structure, c_char_p, c_float, c_int32, c_int64, c_void_p
from functools import cache
from pathlib import Path

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError, DeviceError, NativeError, OutOfMemoryError

ABI_VERSION = 1
FOLDER = Path(__file__).parent / "_native"
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
ERRORS = {1: ArgumentError, 2: OutOfMemoryError, 3: DeviceError}


def _fields(pointers: str, **numbers: type) -> list[tuple[str, type]]:
    return [(name, c_void_p) for name in pointers.split()] + list(numbers.items())


class Surfels(Structure):
    """`texgs_surfels`."""

    _fields_ = [
        ("n", c_int64),
        *_fields("means quats scales opacities shift", channels=c_int32),
        *_fields("features base gain texels sizes offsets", n_texels=c_int64),
    ]


class Camera(Structure):
    """`texgs_camera`."""

    _fields_ = _fields("viewmat K", width=c_int32, height=c_int32)


class RenderOptions(Structure):
    """`texgs_options`."""

    _fields_ = [
        ("background", c_void_p),
        *(
            (name, c_float)
            for name in ("low_pass", "filter_sigma", "alpha_min", "transmittance_min", "near_plane", "far_plane")
        ),
    ]


class Image(Structure):
    """`texgs_image`."""

    _fields_ = _fields("color alpha depth median normal distortion radii")


class Gradients(Structure):
    """`texgs_gradients`."""

    _fields_ = _fields("means quats scales opacities shift features base gain texels")


class Contributions(Structure):
    """`texgs_contributions`."""

    _fields_ = [("image", c_void_p), ("channels", c_int32), *_fields("sums weight_sum weight_max pixels")]


SCENE = [POINTER(Surfels), POINTER(Camera), POINTER(RenderOptions)]
PROTOTYPES = {
    "texgs_forward": [*SCENE, POINTER(Image), POINTER(c_void_p), c_void_p],
    "texgs_backward": [c_void_p, *SCENE, POINTER(Image), POINTER(Image), POINTER(Gradients), c_void_p],
    "texgs_contribute": [c_void_p, *SCENE, POINTER(Contributions), c_void_p],
    "texgs_require_memory": [c_int64],
}


def library_path(device_type: str = "cpu") -> Path:
    """Where the library for "cpu" or "cuda" tensors lies, or would."""
    name = "texgs_cuda" if device_type == "cuda" else "texgs"
    return FOLDER / f"{'' if sys.platform == 'win32' else 'lib'}{name}{SUFFIX}"


@cache
def library(device_type: str = "cpu") -> ctypes.CDLL:
    """Open the library for "cpu" or "cuda" tensors; the second time, the same object.

    Raises:
        DeviceError: if there is no library for such tensors.
        NativeError: if it is missing, does not load, or was built from other sources than this package.
    """
    if device_type not in ("cpu", "cuda"):
        raise DeviceError(f"texgs.raster: expected tensors on cpu or cuda, got {device_type}; move them there")
    path = library_path(device_type)
    if not path.exists():
        hint = "install a CUDA compiler and " if device_type == "cuda" else ""
        raise NativeError(f"{path.name}: not found in {path.parent}; {hint}install texgs again (pip install .)")
    try:
        lib = ctypes.CDLL(str(path))
    except OSError as error:
        raise NativeError(f"{path.name}: cannot be loaded: {error}; install texgs again (pip install .)") from error
    if lib.texgs_abi_version() != ABI_VERSION:
        raise NativeError(
            f"{path.name}: interface version {ABI_VERSION} expected, got {lib.texgs_abi_version()}; "
            "install texgs again (pip install .)"
        )
    for name, arguments in PROTOTYPES.items():
        getattr(lib, name).argtypes = arguments
    lib.texgs_error.restype = lib.texgs_instruction_set.restype = c_char_p
    lib.texgs_memory.restype = c_int64
    lib.texgs_release.argtypes, lib.texgs_release.restype = [c_void_p], None
    if device_type == "cpu":
        lib.texgs_use_openmp.argtypes = [c_void_p]
        lib.texgs_use_openmp(_openmp_of_torch())
    if lib.texgs_instruction_set() is None:
        raise NativeError(lib.texgs_error().decode())
    return lib


def _openmp_of_torch() -> int | None:
    """Address of GOMP_parallel in the OpenMP runtime that torch uses; None where torch has none.

    Two thread pools in one process spin against each other after every parallel loop; sharing torch's avoids it.
    """
    path = Path(torch.__file__).parent / "lib" / "libtorch_cpu.so"
    try:
        return ctypes.cast(ctypes.CDLL(str(path)).GOMP_parallel, c_void_p).value
    except (OSError, AttributeError):
        return None


def instruction_set(device_type: str = "cpu") -> str:
    """Instruction set ("avx512", "avx2", "portable") or CUDA architectures that the library runs."""
    return library(device_type).texgs_instruction_set().decode()


def threads() -> int:
    """Number of threads that the CPU library works with: as many as torch."""
    return torch.get_num_threads()


def peak_memory(reset: bool = False) -> int:
    """The most bytes of scratch memory that the CPU library held since the last reset."""
    return int(library().texgs_memory(int(reset)))


def call(name: str, *arguments, device: torch.device) -> None:
    """Call a function of the library for `device` with its current stream as the last argument.

    Raises:
        ArgumentError, OutOfMemoryError, DeviceError: with the library's own sentence.
    """
    lib = library(device.type)
    if device.type == "cpu":
        lib.texgs_set_threads(threads())
        stream = None
    else:
        stream = torch.cuda.current_stream(device).cuda_stream
    status = getattr(lib, name)(*arguments, stream)
    if status:
        raise ERRORS.get(status, NativeError)(f"texgs.raster: {lib.texgs_error().decode()}")


def require_memory(n_bytes: int, device: torch.device) -> None:
    """Raise OutOfMemoryError, naming `n_bytes`, where less memory than that is left."""
    lib = library(device.type)
    if status := lib.texgs_require_memory(n_bytes):
        raise ERRORS.get(status, NativeError)(f"texgs.raster: {lib.texgs_error().decode()}")


def address(tensor: Tensor | None) -> int | None:
    """Address of a dense tensor's first element, NULL for None."""
    return None if tensor is None else tensor.data_ptr()
