"""Text-driven editing: a guidance edits a few views of a model once, and its texels follow them."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan, degrees
from typing import Literal, NamedTuple

import torch
from torch import Tensor

from texgs.core.camera import Camera, orbit, orbit_direction
from texgs.core.errors import ArgumentError
from texgs.core.light import HEADLIGHT, Light
from texgs.core.memory import require_memory
from texgs.edit.canvas import require_editable
from texgs.edit.hue import HueBound
from texgs.edit.observations import LinearObservation, Target, join_views, observe, render_views
from texgs.edit.steps import Shot, model_at_step, shots_of
from texgs.edit.texel_solver import back_project, fill_unseen, learn, seen_texels, solve
from texgs.fields.optimizer import Rate
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import bare_colors, owners, spread_colors, with_colors, with_single_texels
from texgs.models.guidance import EditViews, Guidance, require_edited
from texgs.models.instruction import require_instruction

SIZE = 512  # pixels along the longer side of the views, as in the training of InstructPix2Pix
BYTES_PER_PIXEL = 64  # of a view: input and output of the guidance, and the colours there
BYTES_PER_SHOT_PIXEL, BYTES_PER_SHOT_SURFEL = 24, 28  # in a view at one opacity
# Azimuth and polar angle of cameras at the front (+z), back, left, right, top and bottom, degrees.
AXES = ((-90, 0), (90, 0), (180, 0), (0, 0), (-90, 90), (-90, -90))
ANY_FOV = 45.0  # degrees; arbitrary, only the directions of these cameras count
BORDER = 1.06  # field of view relative to the scene's bounds: room for the extent of surfels
MIN_DISTANCE = 0.05  # distance to the nearest point, relative to the distance of the middle


@dataclass(frozen=True)
class TextRecipe:
    """Which views are edited, and how texels follow; the defaults are those of `default`."""

    views: Literal["axes", "nearest", "all"] = "axes"  # new views, nearest or all training views
    opacities: tuple[float, ...] = (2.0, 1.0, 0.5)  # factors on the scene's opacity while texels are found
    sweeps: int = 3  # of the solver, where there are no iterations
    iterations: int = 0  # of Adam, through the opacities in order; 0: use the solver
    rate: float = 0.025  # Adam's rate at the start
    final: float = 0.1  # Adam's rate at the end, relative to the start
    target: Target = "colors"  # at each opacity: colours of edited views, or the images
    fills: bool = True  # whether unseen texels take the nearest visible colours
    is_textured: bool = True  # whether each texel follows, or each surfel one colour: the paper's ablation
    material: bool = True  # whether an instruction that names a material also sets its highlights


RECIPES = {
    # One edit of six views; texels are the solution of a linear problem.
    "default": TextRecipe(),
    # Enough where edits of all views agree: once over them, at the opacity that the scene has.
    "quick": TextRecipe(opacities=(1.0,), sweeps=1),
    # One edit of six training views; texels by 1,500 iterations while the opacity falls, as in the paper.
    "paper": TextRecipe(
        "nearest",
        opacities=(2.0, 1.5, 1.0, 0.75, 0.5),
        iterations=1500,
        final=1.0,
        target="images",
        fills=False,
        material=False,
    ),
}


class EditedModel(NamedTuple):
    """The result of a text-driven edit."""

    model: Surfels  # with new texels and offsets of surfels; the rest stays as it was, bit for bit
    views: EditViews  # as the guidance saw them
    images: Tensor  # [V, H, W, 3] as the guidance edited them
    seen: float  # share of the changing texels that edited views show


def edit_by_text(
    model: Surfels,
    cameras: Sequence[Camera],
    guidance: Guidance,
    instruction: str,
    recipe: TextRecipe = RECIPES["default"],
    *,
    light: Light = HEADLIGHT,
    opacity: float = 1.0,
    hue: HueBound | None = None,
    surfels: Tensor | None = None,
    steps: Sequence[Surfels] = (),
    size: int = SIZE,
    seed: int = 0,
    title: str = "text",
) -> EditedModel:
    """Restyle a model by an instruction (the paper's sections Text-Driven NPSE and Text prompt refinement).

    Geometry, material, lighting and palette of the model stay: views of any angle agree, however the edits
    differ. The model may be the result of an edit: its views show that (text prompt refinement). The
    opacity factors of the recipe are those of the search only; the model keeps its own.

    Args:
        model: textured.
        cameras: of the training views, on the model's device; new views are made from as far as the first.
        guidance: edits views, which show light as it wants; texels make up for it, or it falls on them
            afterwards.
        instruction: such as "as a stipple drawing".
        recipe: which views are edited, and how texels follow.
        light: that shines on the scene while it is edited.
        opacity: factor on the model's opacities, with which it is shown before and after the edit.
        hue: of the model's function, which edited views are moved to; by default they keep their own.
        surfels: [N] bool, which may change; all by default. Others keep their colours bit for bit.
        steps: the model at other steps of a series, with the same texels: half as many views again show what
            the model hides.
        size: pixels along the longer side of the six views; training views keep their size.
        seed: of all random numbers; with the same one, machine and versions, results are the same.
        title: of progress bars.
    """
    require_editable(model, surfels)
    instruction = require_instruction(instruction)
    changing = torch.ones(len(model), dtype=torch.bool) if surfels is None else surfels
    changing, shine = changing.to(model.device), light if guidance.lit else None
    generator = torch.Generator().manual_seed(seed)
    means = torch.cat([each.parameters["means"] for each in (model, *steps)])
    shots = shots_of(model, steps, edited_cameras(recipe, cameras, means, size), changing)
    _require_memory(shots, recipe)
    shown = [render_views(each.model, each.cameras, shine, opacity) for each in shots]
    views = join_views(shown)
    edited = require_edited(guidance(views, instruction, generator), views, guidance.name)
    edited = edited if hue is None else hue.toned_views(edited, views.alphas)
    own = model if recipe.is_textured else with_single_texels(model, changing)
    opacities = [opacity * x for x in recipe.opacities]
    rows: list[list[LinearObservation]] = [[] for _ in opacities]
    for shot, part, images in zip(shots, shown, edited.split([*map(len, shown)]), strict=True):
        at, learning = model_at_step(own, shot.model), shot.surfels if recipe.target == "colors" else changing
        observed = observe(at, part, images, shine, opacities, learning, target=recipe.target)
        rows = [[*row, *more] for row, more in zip(rows, observed, strict=True)]
    colors, weights = _follow(rows, own, recipe, hue, generator, title)
    share = _seen_share(weights, own, changing)
    colors = colors if recipe.is_textured else spread_colors(colors, own, model)
    changing = changing if recipe.fills else changing & _shown(weights, own)
    return EditedModel(with_colors(model, colors, changing), views, edited, share)


def _require_memory(shots: Sequence[Shot], recipe: TextRecipe) -> None:
    """Require memory for the views and the equations at each opacity."""
    model, (camera, *_), _ = shots[0]
    count, pixels = sum(len(each.cameras) for each in shots), camera.width * camera.height
    needed = count * (
        BYTES_PER_PIXEL * pixels
        + len(recipe.opacities) * (BYTES_PER_SHOT_PIXEL * pixels + BYTES_PER_SHOT_SURFEL * len(model))
    )
    require_memory(needed, f"{count} views that are edited", "edit fewer views, or smaller ones")


def edited_cameras(
    recipe: TextRecipe, cameras: Sequence[Camera], means: Tensor, size: int
) -> Sequence[Camera]:
    """Return the cameras of the views to edit, from those of the training views; see `edit_by_text`."""
    if recipe.views == "all":
        return cameras
    if recipe.views == "nearest":
        return [camera.resized(size) for camera in nearest_to_axes(cameras, means)]
    return axis_cameras(cameras[0].resized(size), means)


def axis_cameras(like: Camera, points: Tensor) -> list[Camera]:
    """Return new cameras exactly along the six axes of a scene of points [N, 3], which it fills.

    They look at the middle of the scene from as far as another camera does, with the narrowest field of view
    that shows all of it in all six: a guidance works best on a large object, and pixels become texels.
    """
    center = _center(points)
    radius = float((like.position.cpu().double() - center).norm())
    tangent = _widest(points.detach().cpu().double() - center, radius, like.width / like.height)
    fov = degrees(2 * atan(BORDER * tangent))
    size, target = (like.width, like.height), center.tolist()
    placed = (orbit(azimuth, polar, radius, fov, *size, target) for azimuth, polar in AXES)
    return [camera.to(like.viewmat.device) for camera in placed]


def nearest_to_axes(cameras: Sequence[Camera], points: Tensor) -> list[Camera]:
    """Choose the six different cameras whose directions from points [N, 3] are nearest to the axes.

    The sum of the cosines of the angles between cameras and axes is largest.
    """
    from scipy.optimize import linear_sum_assignment

    if len(cameras) < len(AXES):
        raise ArgumentError(
            f"cameras: expected {len(AXES)} at least to choose those nearest to the axes from, got "
            f"{len(cameras)}; edit new views along the axes instead (edit.text.views=axes)"
        )
    directions = torch.stack([camera.position.cpu().double() for camera in cameras]) - _center(points)
    axes = torch.stack([orbit_direction(*angles) for angles in AXES])  # [6, 3]
    cosines = axes @ torch.nn.functional.normalize(directions, dim=1).T  # [6, V]
    _, chosen = linear_sum_assignment(cosines.numpy(), maximize=True)
    return [cameras[index] for index in chosen.tolist()]


def _center(points: Tensor) -> Tensor:
    """Return the middle of the box around points [N, 3], float64 on the CPU."""
    points = points.detach().cpu().double()
    return 0.5 * (points.amin(dim=0) + points.amax(dim=0))


def _widest(points: Tensor, radius: float, aspect: float) -> float:
    """Return the tangent of half the vertical field of view that holds points [N, 3] around the origin."""
    widest = 1e-3
    for azimuth, polar in AXES:
        R_cw = orbit(azimuth, polar, radius, ANY_FOV, 2, 2).viewmat[:3, :3].to(points)
        x, y, z = (points @ R_cw.T).unbind(dim=1)
        if float(z.min()) + radius < MIN_DISTANCE * radius:
            raise ArgumentError(
                f"like: expected a camera well outside of the scene, got one {radius:.3g} from its middle, "
                "which is too near; pass one farther away"
            )
        high, wide = (float((sides.abs() / (z + radius)).max()) for sides in (y, x))
        widest = max(widest, high, wide / aspect)
    return widest


def _follow(
    rows: list[list[LinearObservation]],
    model: Surfels,
    recipe: TextRecipe,
    hue: HueBound | None,
    generator: torch.Generator,
    title: str,
) -> tuple[Tensor, Tensor]:
    """Return bare colours [T, 3], as the recipe says where nothing is seen, and how much each is seen [T]."""
    observations = [observation for row in rows for observation in row]
    sums = back_project(observations, model)
    if recipe.iterations:
        rate, start = Rate(recipe.rate, recipe.final), bare_colors(model).clamp(0, 1)
        steps = recipe.iterations
        colors = learn(rows, start, rate=rate, steps=steps, generator=generator, title=title)
        colors = fill_unseen(colors, sums.weights, model) if recipe.fills else colors
    else:
        start, sweeps = fill_unseen(sums.colors, sums.weights, model), recipe.sweeps
        colors = solve(observations, sums.curvature, start, sweeps=sweeps, generator=generator, title=title)
    colors = colors if hue is None else hue.at_texels(colors, model)
    if not recipe.fills:
        colors = torch.where(sums.weights[:, None] > 0, colors, bare_colors(model))
    return colors, sums.weights


def _shown(weights: Tensor, model: Surfels) -> Tensor:
    """Return which surfels [N] have a texel that is seen at all, by how much each one is [T]."""
    place, surfel = owners(model.parameters)
    return weights.new_zeros(len(model)).index_add_(0, surfel, weights[place]) > 0


def _seen_share(weights: Tensor, model: Surfels, changing: Tensor) -> float:
    """Return the share of the texels of some surfels [N] that is seen."""
    place, surfel = owners(model.parameters)
    mine = torch.zeros(len(weights), dtype=torch.bool, device=weights.device)
    mine[place] = changing[surfel]
    share = float(seen_texels(weights)[mine].double().mean())
    if share == 0:
        raise ArgumentError(
            "views: expected some that show what is to change, got none; choose other views "
            "(edit.text.views), or edit something that is less faint"
        )
    return share
