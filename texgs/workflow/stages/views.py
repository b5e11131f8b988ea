"""Stage `views`: render the training and test views of one basic TF, and a turntable."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import mean, median
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError
from texgs.core.names import is_number
from texgs.report.results import ViewsResult
from texgs.volume.basic_tfs import BasicTF, basic_tfs_of
from texgs.volume.view_settings import ViewKeys, appearance_of, views_of
from texgs.workflow.inputs import has_volume, prepared_volume, view_settings
from texgs.workflow.locate import basic_tf
from texgs.workflow.result import TIMES
from texgs.workflow.stage import Config, Outcome, Rule, Stage, read
from texgs.workflow.stages.settings import OfTF

if TYPE_CHECKING:
    from texgs.volume.grid import Grid
    from texgs.volume.render import Times, VolumeRenderer
    from texgs.volume.transfer import TransferFunction
    from texgs.volume.view_set import View


def framed_tfs(config: Config) -> dict[str, BasicTF]:
    """Return where basic TFs show something, which frames views; none where their distance is given."""
    dataset, names = config.dataset, config.dataset.framing if config.views.radius is None else []
    white = [[0.0, 1.0, 1.0, 1.0]]
    framing = {name: dataset.basic_tfs[name] for name in names}
    return {name: replace(tf, opacity=[*map(shows, tf.opacity)], color=white) for name, tf in framing.items()}


def shows(point: Any) -> Any:
    """Return a point of an opacity as 0 or 1; one that is malformed, which is told later, as it is."""
    is_point = isinstance(point, list) and len(point) == 2 and all(map(is_number, point))
    return [point[0], float(point[1] > 0)] if is_point else point


@dataclass(kw_only=True)
class Settings(OfTF):
    """What the stage reads of the configuration."""

    tf_values: str = read("dataset.tf_values")
    points: BasicTF = read(basic_tf)
    framed: dict[str, BasicTF] = read(framed_tfs)  # what all views show, perhaps with parts of others
    views: ViewKeys = read(view_settings)
    vtk_frames: int = read("metric.vtk_frames")


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write the folder of views: train/, test/, relit/, transforms_*.json, turntable.png, and times.json.

    Views that are in the folder already, from an interrupted run of the same job, are kept, and so are
    their times.

    It reads `volume`, the volume.nrrd; volume.json is beside it.
    """
    from texgs.volume.caster import Caster
    from texgs.volume.framing import frame_of, out_of_frame
    from texgs.volume.nrrd_file import open_grid
    from texgs.volume.render import Times, render_views
    from texgs.volume.view_files import renderer_for, turntable, vtk_frame_ms, write_geometry
    from texgs.volume.view_set import write_transforms

    views, title = settings.views, f"{settings.dataset}/{settings.tf}"
    grid = open_grid(inputs["volume"])
    (tf,) = basic_tfs_of(inputs["volume"], {settings.tf: settings.points}, settings.tf_values).values()
    appearance = appearance_of(views)
    renderer = renderer_for(views.renderer, grid, appearance, tf)
    times, coverages = Times(output / TIMES), []
    framed = basic_tfs_of(inputs["volume"], settings.framed, settings.tf_values)
    frame = frame_of(grid, framed.values()) if framed else None
    if frame and settings.tf not in framed and (far := out_of_frame(grid, tf, frame)):
        print(f"basic TF {title} {far}", file=sys.stderr)
    lens = views.lens(frame)
    shots = views_of(views, lens, output)
    for split, shot in shots.items():
        render_views(renderer, tf, shot, f"{title}: {split} views", times)
        coverages += [float((view.load()[..., 3] > 0).float().mean()) for view in shot]
        if not any(coverages):  # the training views come first
            raise ArgumentError(
                f"basic TF {title}: expected to see something, but all views are empty; raise its opacity"
            )
    turntable(renderer, tf, views.turntable, lens, output, title)
    if views.geometry:
        caster = renderer if isinstance(renderer, Caster) else Caster(grid, appearance)
        write_geometry(caster, tf, shots["test"], output / "geometry", title)
    for split, shot in shots.items():
        write_transforms(output, split, shot, describe(settings, tf, grid, renderer))
    result = result_of(shots, times, coverages)
    if settings.vtk_frames:
        by_vtk = vtk_frame_ms(grid, appearance, tf, shots["test"][: settings.vtk_frames], title)
        result = replace(result, vtk_frame_ms=by_vtk)
    return Outcome(result, {"turntable.png": "One turn around the volume."})


def describe(
    settings: Settings, tf: TransferFunction, grid: Grid, renderer: VolumeRenderer
) -> dict[str, Any]:
    """Return what transforms_*.json says about the images beside cameras and lights."""
    views = settings.views
    return {
        "volume": settings.dataset,
        "tf": {"name": settings.tf, **tf.to_dict()},
        "aabb": [list(corner) for corner in grid.aabb],
        "shading": {"model": "blinn-phong", "local_viewer": renderer.local_viewer, **asdict(views.shading)},
        "renderer": views.renderer,
        "step": views.step,
        "opacity_unit": views.opacity_unit,
    }


def result_of(shots: Mapping[Any, list[View]], times: Times, coverages: list[float]) -> ViewsResult:
    """Return counts, sizes, mean coverage, and the time per view over all runs that this job took."""
    camera, frames = shots["train"][0].camera, times.others
    counts = len(shots["train"]), len(shots["test"])
    result = ViewsResult(*counts, camera.width, camera.height, mean(coverages))
    if not frames:
        return result
    first = times.first[0]
    return replace(
        result, frame_ms=median(frames), frame_max_ms=max(frames), first_frame_ms=first, frames_ms=frames
    )


STAGE = Stage(
    "views",
    order=30,
    help="render the training and test views of basic transfer functions",
    rule=Rule(
        "views",
        "{dataset}/{tf}/{views}",
        ("transforms_train.json", "transforms_test.json", "turntable.png"),
        gpu=("views",),
        swept=True,
    ),
    inputs=prepared_volume,
    work=work,
    applies=has_volume,
)
