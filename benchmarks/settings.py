"""What to measure: the arguments of `python -m benchmarks`."""

import argparse
from dataclasses import dataclass
from pathlib import Path

import torch

from benchmarks.scenes import KINDS
from texgs.core.errors import ArgumentError

NAMES = (
    "rasterize outputs primitives losses peers instruction_sets memory views fit scene convolution style"
    " voxels"
)
SECTIONS = tuple(NAMES.split())
ROUNDS = 5  # visits to each case, see timing.py


@dataclass(frozen=True)
class Settings:
    """What to measure, and how often."""

    scenes: tuple[str, ...]
    sizes: tuple[int, ...]  # edge of the square image in pixels, ascending
    surfels: tuple[int, ...]  # ascending
    threads: tuple[int, ...]  # ascending; only for the CPU
    device: torch.device
    rounds: int
    sections: tuple[str, ...]
    is_quick: bool
    json: Path | None  # None: a name is chosen

    @property
    def scene(self) -> str:
        """The scene of sections that look at one: opaque where it is measured."""
        return "opaque" if "opaque" in self.scenes else self.scenes[0]

    @property
    def n_surfels(self) -> int:
        """The number of surfels of sections that look at one: the middle."""
        return self.surfels[len(self.surfels) // 2]

    @property
    def size(self) -> int:
        """The image of sections that look at one: the largest."""
        return self.sizes[-1]

    def where(self, **more: object) -> dict:
        """Parameters of a measurement at the middle of everything."""
        return {"scene": self.scene, "size": self.size, "surfels": self.n_surfels} | more


def parse(arguments: list[str] | None = None) -> Settings:
    """Settings from the command line.

    Raises:
        ArgumentError: if a GPU is asked for and torch sees none.
    """
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Measure rasterizer, losses, volume rendering, training, scenes and edits; write JSON.",
    )
    parser.add_argument(
        "--quick", action="store_true", help="few cases, each timed once: seconds, not minutes"
    )
    parser.add_argument("--threads", type=int, nargs="+", help="default: 1 and as many as torch uses")
    parser.add_argument("--scenes", nargs="+", choices=KINDS, help="default: all")
    parser.add_argument("--sizes", type=int, nargs="+", help="image edges in pixels; default: 400 800")
    parser.add_argument("--surfels", type=int, nargs="+", help="default: 15000 60000 240000")
    parser.add_argument("--sections", nargs="+", choices=SECTIONS, default=SECTIONS, help="default: all")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    parser.add_argument("--json", type=Path, help="default: benchmarks/results/<date>-<device>.json")
    given = parser.parse_args(arguments)
    numbers = (*(given.threads or ()), *(given.sizes or ()), *(given.surfels or ()))
    if min(numbers, default=1) < 1:
        parser.error("--threads, --sizes, --surfels: expected numbers of at least 1")
    if given.device == "cuda" and not torch.cuda.is_available():
        raise ArgumentError("--device cuda: torch sees no GPU; leave it out to measure the CPU")
    return _complete(given)


def _complete(given: argparse.Namespace) -> Settings:
    """Settings with defaults filled in."""
    most = torch.get_num_threads()
    threads = given.threads or (1, most)
    quick = given.quick
    return Settings(
        scenes=tuple(given.scenes or (("opaque", "transl") if quick else KINDS)),
        sizes=_ascending(given.sizes or ((400,) if quick else (400, 800))),
        surfels=_ascending(given.surfels or ((15_000,) if quick else (15_000, 60_000, 240_000))),
        threads=_ascending(threads) if given.device == "cpu" else (most,),
        device=torch.device(given.device),
        rounds=1 if quick else ROUNDS,
        sections=tuple(given.sections),
        is_quick=quick,
        json=given.json,
    )


def _ascending(numbers: tuple[int, ...] | list[int]) -> tuple[int, ...]:
    return tuple(sorted(set(numbers)))
