"""The steps of a series in time in a page, as differences from the step that it begins with."""

import json
import zlib
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch

from texgs.core.errors import ArgumentError
from texgs.core.progress import progress
from texgs.fields.files import open_field
from texgs.fields.surfels.compact import codes_of
from texgs.fields.surfels.step_file import differences
from texgs.scene.scene import Scene

MEGABYTE = 10**6
# What differences are whole numbers of. A pixel of a view of 800 x 800 is about 2^-9 world units wide; half a
# unit of a colour is half a level of an 8-bit picture. Scales are logarithms, opacities logits.
UNITS = {"means": 2**-13, "quats": 2**-9, "scales": 2**-6, "opacities": 2**-6, "colors": 2**-8}
UNITS |= {"normals": 2**-9}  # of models that have them


@dataclass(frozen=True, eq=False)
class PageSteps:
    """Steps of a series in a page, which begins with one of them."""

    packed: Mapping[int, str]  # by number, in order; see `pack_steps`
    total: int  # steps of the series

    @property
    def size(self) -> int:
        """Return bytes in the page."""
        return sum(map(len, self.packed.values()))

    def __str__(self) -> str:
        """Say which steps are there."""
        if len(self.packed) == 1:
            return f"step {min(self.packed)} alone, of {self.total} in the series"
        return f"{len(self.packed)} of {self.total} steps in {self.size / MEGABYTE:.2f} MB"


def page_steps(scene: Scene, steps: str | int = "all") -> PageSteps | None:
    """Return the steps of a scene's series; None where it has none.

    Args:
        scene: at the step that the page begins with.
        steps: "all"; "one", that of the scene; or a number N, each N-th, of which one is that of the scene.

    Raises:
        ArgumentError: if `steps` is none of these, or more than "all" without a series, or a file of a step
            cannot be read.
    """
    if scene.series is None or scene.time is None:
        if steps != "all":
            raise ArgumentError(f"steps: expected a series in time for {steps!r:.100}, got another scene")
        return None
    total = len(scene.series.steps)
    every = {"all": 1, "one": total}.get(str(steps)) or (int(steps) if str(steps).isdecimal() else 0)
    if every < 1:
        raise ArgumentError(f"steps: expected all, one or a number N for each N-th step, got {steps!r:.100}")
    held = range(scene.time % every, total, every)
    return PageSteps(pack_steps(scene, held) if len(held) > 1 else {scene.time: ""}, total)


def pack_steps(scene: Scene, times: Sequence[int]) -> dict[int, str]:
    """Return steps of a series by number, as differences from that of the scene.

    Each is a zlib stream of safetensors, as base64. NUMBER.codes of a model, see `codes_of`, have a row for
    each component of `UNITS`, one after the other.
    """
    from safetensors.numpy import save

    numbers = {name: number for number, name in enumerate(scene.models) if name in scene.timeline.models}
    keys = {name: open_field(scene.models[name].file) for name in numbers}
    first = {name: scene.models[name].surfels(keys[name])[0] for name in numbers}
    packed = {}
    for time in progress(times, title="steps of the page", unit="step"):
        codes, models = {}, scene.at(time).models
        for name, number in numbers.items():
            gone = differences(first[name], models[name].surfels(keys[name])[0])
            rows = [(gone[key] / unit)[:, None].flatten(1).T for key, unit in UNITS.items() if key in gone]
            codes[f"{number}.codes"] = codes_of(torch.cat(rows).round().int())
        packed[time] = b64encode(zlib.compress(save(codes, {"units": json.dumps(UNITS)}), 9)).decode()
    return packed
