"""Transfer functions from files, our JSON and ParaView's presets, and to the latter."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.errors import ArgumentError, errors_at
from texgs.core.io import read_json, reading_as, write_json
from texgs.core.names import is_number
from texgs.volume.transfer import TransferFunction

Point = tuple[float, float, float, float]

FORMAT, VERSION = "texgs-tf", 1
SPACES = ("RGB", "HSV", "Lab", "Diverging", "Lab/CIEDE2000", "Step")  # at VTK's number of each
SAMPLES = 256  # shared by the segments of a function that is not linear, four each at least
LINEAR_POINTS = 64  # points of colour; with more, the colour space makes no difference
END_OFFSET = 1e-6  # of a segment: how close to its ends it is sampled


def read_tf(path: str | Path) -> TransferFunction:
    """Read a transfer function from our JSON or from a file of one of ParaView's presets (.json).

    What is not piecewise linear in ParaView, colour spaces other than RGB (of fewer than 64 points) and
    opacity with a midpoint or a sharpness, is sampled by VTK at 256 points or so. A preset
    without opacity gets the ramp from 0 to 1 over its range, which is ParaView's default. Presets are often
    given over [0, 1]: see `TransferFunction.scaled`.
    """
    data = read_json(path)
    with errors_at(path), reading_as("a transfer function"):
        if isinstance(data, dict) and data.get("format") == FORMAT:
            return _from_ours(data)
        presets = data if isinstance(data, list) else [data]
        if presets and all(
            isinstance(p, dict) and p.keys() & {"RGBPoints", "IndexedColors"} for p in presets
        ):
            return _from_preset(presets)
    raise ArgumentError(
        f'{path}: expected a transfer function with "format": "{FORMAT}" or a list of ParaView presets, got '
        "neither; export it from ParaView, or take a *.paraview.json from results/DATASET/transfer"
    )


def write_paraview(path: str | Path, tf: TransferFunction, name: str) -> Path:
    """Write a .json of one preset that ParaView imports, colour and opacity; steps become narrow ramps."""
    tf = tf.without_steps()
    # ParaView stretches colour and opacity to the data, each from its own range: give both the same.
    low = min(tf.opacity[0][0], tf.color[0][0])
    high = max(tf.opacity[-1][0], tf.color[-1][0])
    preset = {
        "Name": name,
        "ColorSpace": "RGB",
        "RGBPoints": [x for point in _extend(tf.color, low, high) for x in point],
        "Points": [x for point in _extend(tf.opacity, low, high) for x in (*point, 0.5, 0.0)],
    }
    return write_json(path, [preset])


def _from_ours(data: dict[str, Any]) -> TransferFunction:
    """Return the function of a file of ours."""
    if data.get("version") != VERSION:
        raise ArgumentError(f"version: expected {VERSION}, got {data.get('version')!r}; update texgs")
    if "channel" in data:
        raise ArgumentError("channel: expected a function for any channel; leave it out")
    return TransferFunction.from_dict({k: v for k, v in data.items() if k not in ("format", "version")})


def _from_preset(presets: list[dict[str, Any]]) -> TransferFunction:
    """Return the function of the only preset of ParaView."""
    if len(presets) > 1:
        names = ", ".join(str(preset.get("Name")) for preset in presets[:10])
        raise ArgumentError(f"expected one preset, got {len(presets)}: {names}; export one of them alone")
    (preset,) = presets
    if "RGBPoints" not in preset:
        raise ArgumentError(
            f"preset {preset.get('Name')!r}: expected RGBPoints, got a categorical colour map; choose another"
        )
    color = _fours(preset, "RGBPoints")
    for _, *rgb in color:  # VTK turns hues by full turns, without end where a colour is far above 1
        if not all(0 <= x <= 1 for x in rgb):
            raise ArgumentError(f"RGBPoints: expected r, g, b in [0, 1], got {rgb!r:.60}")
    ramp = [(color[0][0], 0.0, 0.5, 0.0), (color[-1][0], 1.0, 0.5, 0.0)]
    nodes = _fours(preset, "Points") if preset.get("Points") else ramp
    if not all(0 <= x <= 1 for _, _, *shape in nodes for x in shape):
        raise ArgumentError("Points: expected midpoints and sharpnesses from 0 to 1, got others")
    space = preset.get("ColorSpace", "RGB")
    if space not in SPACES:
        raise ArgumentError(f"ColorSpace: expected one of {', '.join(SPACES)}, got {space!r}")
    is_curved = space == "Step" or (space != "RGB" and len(color) < LINEAR_POINTS)
    if is_curved and color[0][0] < color[-1][0]:
        color = _sampled_color(color, SPACES.index(space), bool(preset.get("HSVWrap")))
    if all((middle, sharpness) == (0.5, 0) for _, _, middle, sharpness in nodes):
        return TransferFunction(tuple((value, alpha) for value, alpha, _, _ in nodes), tuple(color))
    return TransferFunction(_sampled_opacity(nodes), tuple(color))


def _fours(preset: dict[str, Any], key: str) -> list[Point]:
    """Return a flat list as points of four numbers, sorted by value as ParaView does."""
    numbers = preset[key]
    if not isinstance(numbers, list) or not all(map(is_number, numbers)):
        raise ArgumentError(f"{key}: expected a list of numbers, got {numbers!r:.60}")
    if len(numbers) % 4 or not numbers:
        raise ArgumentError(f"{key}: expected four numbers per point, got {len(numbers)} numbers")
    columns = (numbers[i::4] for i in range(4))
    return sorted(zip(*columns, strict=True), key=lambda point: point[0])


def _sampled_color(points: Sequence[Point], space: int, wrap: bool) -> Any:
    """Return points of colours that are not linear in RGB."""
    from vtkmodules.vtkRenderingCore import vtkColorTransferFunction

    function = vtkColorTransferFunction()
    function.AllowDuplicateScalarsOn()
    function.SetColorSpace(space)
    function.SetHSVWrap(wrap)
    for point in points:
        function.AddRGBPoint(*point)
    return _sample(function, [value for value, *_ in points], channels=3)


def _sampled_opacity(nodes: Sequence[Point]) -> Any:
    """Return points of opacities with midpoints or sharpnesses."""
    from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction

    function = vtkPiecewiseFunction()
    function.AllowDuplicateScalarsOn()
    for node in nodes:
        function.AddPoint(*node)
    middles = [a + middle * (b - a) for (a, _, middle, _), (b, *_) in pairwise(nodes)]
    return _sample(function, sorted([*(value for value, *_ in nodes), *middles]), channels=1)


def _sample(function: Any, values: Sequence[float], channels: int) -> Any:
    """Return points of a VTK function between neighbouring values; at these the limits from inside."""
    count = max(SAMPLES // len(values), 4)
    points: list[list[float]] = []
    for a, b in pairwise(values):
        if a < b:
            table = np.empty(count * channels)
            function.GetTable(a + END_OFFSET * (b - a), b - END_OFFSET * (b - a), count, table)
            heights = table.reshape(count, channels).clip(0, 1)
            rows = np.column_stack([np.linspace(a, b, count), heights]).tolist()
            is_continuous = bool(points) and np.allclose(points[-1], rows[0], rtol=0, atol=1e-4)
            points += rows[1:] if is_continuous else rows
    return points


def _extend(points: Sequence[tuple[float, ...]], low: float, high: float) -> list[tuple[float, ...]]:
    """Return the points with the first and the last continued to the ends of a range."""
    first = [(low, *points[0][1:])] if points[0][0] > low else []
    last = [(high, *points[-1][1:])] if points[-1][0] < high else []
    return [*first, *points, *last]
