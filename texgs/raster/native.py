"""The native libraries: find, open and describe them to ctypes; turn errors of calls into exceptions.

`libtexgs` works on CPU tensors, `libtexgs_cuda` on CUDA tensors; both export the functions of `csrc/texgs.h`,
`texgs_losses.h`, `texgs_fit.h`, `texgs_grid.h`, `texgs_volume.h` and `texgs_light.h`, the first also those of
`texgs_fusion.h` and `texgs_neural.h`. They know raw pointers only, so that one build serves every version of
torch and Python. A module declares the structures and functions that it calls.
"""

import ctypes
import sys
import weakref
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from ctypes import POINTER, Structure, addressof, c_char_p, c_double, c_float, c_int32, c_int64, c_void_p
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any, cast

import torch
from torch import Tensor

from texgs.core import memory
from texgs.core.errors import ArgumentError, DeviceError, NativeError, OutOfMemoryError, Stopped
from texgs.core.native_sources import CUDA_ADVICE, SUFFIX, built_from, library_sources

ABI_VERSION = 10
FOLDER = Path(__file__).parent / "_native"
CSRC = Path(__file__).parent / "csrc"
INSTALL_ADVICE = "install texgs again (pip install .)"
ERRORS = {1: ArgumentError, 2: OutOfMemoryError, 3: DeviceError, 4: Stopped}
PASSES = ("project", "sort", "bin", "forward", "backward", "reduce")  # in the order of `texgs_pass`
TYPES = {"p": c_void_p, "i": c_int32, "n": c_int64, "f": c_float}
DECLARATIONS: dict[str, tuple[list[Any], Any]] = {}  # arguments and result of each function of the libraries
_stop: ContextVar[c_int32 | None] = ContextVar("stop", default=None)


def fields(layout: str) -> list[tuple[str, Any]]:
    """Return the fields of a structure: "p means quats, 3i size" has two pointers and three integers."""
    result = []
    for part in layout.split(","):
        kind, *names = part.split()
        ctype = TYPES[kind] if kind in TYPES else TYPES[kind[-1]] * int(kind[:-1])
        result += [(name, ctype) for name in names]
    return result


class Struct(Structure):
    """A structure of the library; it holds tensors by address and keeps them alive."""

    def __init__(self, *values: Any, **named: Any) -> None:
        self.kept = values, named
        super().__init__(*map(as_ctypes, values), **{name: as_ctypes(x) for name, x in named.items()})


def struct(name: str, layout: str) -> type[Struct]:
    """Define the type of a structure of the library by its name there and `fields`."""
    return cast(type[Struct], type(name, (Struct,), {"_fields_": fields(layout)}))


def as_ctypes(value: Any) -> Any:
    """Convert a value for ctypes: a dense tensor to its address, None to NULL."""
    return value.data_ptr() if isinstance(value, Tensor) else value


def gradients(tensors: Iterable[Tensor | None], wanted: Iterable[bool]) -> list[Tensor | None]:
    """Allocate gradients for the tensors that need one."""
    pairs = zip(tensors, wanted, strict=True)
    return [torch.empty_like(x) if want and x is not None else None for x, want in pairs]


class Handle:
    """Owns an object of the library between calls; the library writes its address to `pointer`.

    A call that changes it holds the lock: two threads may go back through one graph.
    """

    def __init__(self, release: str, device: torch.device) -> None:
        self.pointer, self.lock = c_void_p(), Lock()
        weakref.finalize(self, function(library(device.type), release), self.pointer)


def declare(name: str, *arguments: str | type[Structure], result: Any = c_int32, stream: bool = True) -> None:
    """State the C types of a function: structures, which it takes by address, and letters of TYPES.

    The result is a status by default; a stream follows the arguments, as `call` passes it, or none does.
    """
    types: list[Any] = []
    for each in arguments:
        types += [TYPES[x] for x in each.replace(" ", "")] if isinstance(each, str) else [POINTER(each)]
    DECLARATIONS[name] = [*types, c_void_p] if stream else types, result


for _name, _result, _arguments in (
    ("texgs_abi_version", c_int32, ""),
    ("texgs_sources", c_char_p, ""),
    ("texgs_error", c_char_p, ""),
    ("texgs_instruction_set", c_char_p, ""),
    ("texgs_require_memory", c_int32, "n"),
    ("texgs_trim", None, ""),
    ("texgs_use_openmp", None, "p"),
    ("texgs_set_loops", None, "ip"),
    ("texgs_memory", c_int64, "i"),
    ("texgs_pass_seconds", None, "p"),
):
    declare(_name, _arguments, result=_result, stream=False)


def library_path(device_type: str = "cpu") -> Path:
    """Return the path of the library for "cpu" or "cuda" tensors, whether or not it exists."""
    name = "texgs_cuda" if device_type == "cuda" else "texgs"
    return FOLDER / f"{'' if sys.platform == 'win32' else 'lib'}{name}{SUFFIX}"


@cache
def library(device_type: str = "cpu") -> ctypes.CDLL:
    """Open the library for "cpu" or "cuda" tensors, once."""
    if device_type not in ("cpu", "cuda"):
        raise DeviceError(f"texgs.raster: expected tensors on cpu or cuda, got {device_type}; move them")
    path = library_path(device_type)
    if not path.exists():
        advice = CUDA_ADVICE if device_type == "cuda" else INSTALL_ADVICE
        raise NativeError(f"{path.name}: not found in {path.parent}; {advice}")
    try:
        lib = ctypes.CDLL(str(path))
    except OSError as error:
        raise NativeError(f"{path.name}: cannot be loaded: {error}; {INSTALL_ADVICE}") from error
    version = function(lib, "texgs_abi_version")()
    if version != ABI_VERSION:
        raise NativeError(
            f"{path.name}: interface version {ABI_VERSION} expected, got {version}; {INSTALL_ADVICE}"
        )
    _require_own_sources(lib)
    if device_type == "cpu":
        function(lib, "texgs_use_openmp")(_openmp_of_torch())
    if function(lib, "texgs_instruction_set")() is None:
        raise NativeError(function(lib, "texgs_error")().decode())
    return lib


def _require_own_sources(lib: ctypes.CDLL) -> None:
    """Require that a library in a source tree was built from the current sources."""
    expected, built = library_sources(), built_from(function(lib, "texgs_sources"))
    if CSRC.is_dir() and built != expected:
        raise NativeError(
            f"{Path(lib._name).name}: built from other sources ({built}) than those in {CSRC} ({expected}); "
            "compile them with `make install`"
        )


def function(lib: ctypes.CDLL, name: str) -> Any:
    """Return a declared function of a library; a library from other sources may lack it."""
    try:
        found = getattr(lib, name)
    except AttributeError:
        raise NativeError(f"{Path(lib._name).name}: has no function {name}; {INSTALL_ADVICE}") from None
    if found.argtypes is None:
        found.argtypes, found.restype = DECLARATIONS[name]
    return found


def _openmp_of_torch() -> int | None:
    """Return the address of GOMP_parallel in the OpenMP runtime that torch uses; None where torch has none.

    Two thread pools in one process spin against each other after every parallel loop; sharing torch's avoids
    it.
    """
    path = Path(torch.__file__).parent / "lib" / "libtorch_cpu.so"
    try:
        return ctypes.cast(ctypes.CDLL(str(path)).GOMP_parallel, c_void_p).value
    except (OSError, AttributeError):
        return None


def instruction_set(device_type: str = "cpu") -> str:
    """Return the instruction set ("avx512", "avx2", "portable") or CUDA architectures in use."""
    return str(function(library(device_type), "texgs_instruction_set")().decode())


def threads() -> int:
    """Return the number of threads of the CPU library, the same as torch's."""
    return torch.get_num_threads()


def peak_memory(reset: bool = False, device_type: str = "cpu") -> int:
    """Return the most bytes of scratch memory that a library held since the last reset."""
    return int(function(library(device_type), "texgs_memory")(int(reset)))


def release_memory(device_type: str = "cpu") -> None:
    """Free the scratch memory that a library keeps for the next views."""
    function(library(device_type), "texgs_trim")()


def pass_seconds() -> dict[str, float]:
    """Return the seconds that each of PASSES took in the calling thread's latest calls of the CPU library."""
    seconds = (c_double * len(PASSES))()
    function(library(), "texgs_pass_seconds")(seconds)
    return dict(zip(PASSES, seconds, strict=True))


@contextmanager
def stopped_by(flag: c_int32) -> Iterator[None]:
    """Make calls of this thread raise Stopped once another thread sets a flag, within the block.

    A call on a CPU ends within milliseconds, and its outputs are unfinished; one on a GPU goes on.
    """
    before = _stop.set(flag)
    try:
        yield
    finally:
        _stop.reset(before)


def call(name: str, *arguments, device: torch.device) -> None:
    """Call a function of the library for `device` with its current stream as the last argument.

    Tensors are dense; the library gets their address, and NULL for None.
    """
    lib = library(device.type)
    if device.type == "cpu":
        flag = _stop.get()
        function(lib, "texgs_set_loops")(threads(), None if flag is None else addressof(flag))
        stream = None
    else:
        stream = torch.cuda.current_stream(device).cuda_stream
    _require_success(function(lib, name)(*map(as_ctypes, arguments), stream), lib, device)


def require_memory(n_bytes: int, device: torch.device, what: str, advice: str) -> None:
    """Raise OutOfMemoryError, naming `n_bytes`, where less memory than that is left for something."""
    lib = library(device.type)
    with torch.cuda.device(device) if device.type == "cuda" else nullcontext():
        status = function(lib, "texgs_require_memory")(n_bytes)
    _require_success(status, lib, device)
    if device.type == "cpu":  # the C library hands out more than there is
        memory.require_memory(n_bytes, f"texgs.raster: {what}", advice)


def _require_success(status: int, lib: ctypes.CDLL, device: torch.device) -> None:
    if not status:
        return
    error = ERRORS.get(status, NativeError)
    kept_by_torch = error is OutOfMemoryError and device.type == "cuda"
    hint = "; torch.cuda.empty_cache() gives back what torch keeps" if kept_by_torch else ""
    raise error(f"texgs.raster: {function(lib, 'texgs_error')().decode()}{hint}")
