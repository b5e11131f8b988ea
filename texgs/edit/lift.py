"""Segments from clicks on one view: masks of many views, and surfels that their votes select."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.geometry import nearest
from texgs.core.light import HEADLIGHT, Light
from texgs.core.progress import progress
from texgs.edit.clicks import FAINT, TOLERANCE, Clicks, extent, is_visible, places_of
from texgs.edit.votes import CentreVotes, ContributionVotes, Vote
from texgs.fields.splats import screen_box
from texgs.fields.surfels.model import Surfels
from texgs.models.masks import MaskModel

WHOLE_SHARE = 0.9  # share of a model above which a segment is suspiciously large
CERTAIN_SHARE = 0.8  # share of votes above which surfels replace clicks hidden from a view
AGREEMENT = 0.5  # smallest overlap of a mask with earlier views; below it the mask model lost the object
TOUCH_SIGMAS = 2.0  # standard deviations of two surfels together, within which they touch
PIECE_SHARE = 0.1  # smallest piece to look for in other views, relative to the outline's largest
NEIGHBOURS = 16  # nearest surfels to test for a connection
Find = Callable[[Clicks], Tensor]  # the mask [H, W] of a view


@dataclass(frozen=True, eq=False)
class Lifted:
    """A segment, and the evidence for it."""

    mask: Tensor  # [N] bool
    reference: Tensor  # [H, W] bool, the mask of the view that was clicked on
    used: int  # views whose masks voted
    left_out: int  # views without the object, or with masks that disagree

    @property
    def basis(self) -> str:
        """Describe the number of views behind the segment, and warn if it is almost the whole model."""
        views = f"masks of {self.used} of {self.used + self.left_out} views"
        share = float(self.mask.float().mean())
        if share < WHOLE_SHARE:
            return views
        return f"{views} hold {share:.0%} of the model; if that is too much, click beside the object as well"


@torch.no_grad()
def lift(
    model: Surfels,
    clicks: Clicks,
    cameras: Sequence[Camera],
    masks: MaskModel,
    *,
    light: Light = HEADLIGHT,
    vote: Vote = "contribution",
    threshold: float | None = None,
    connected: bool = False,
    title: str = "segment",
) -> Lifted:
    """Segment a model by clicks on one view of it (the paper's 2D-lift-3D segmentation).

    The views are visited from the clicked one outwards. Clicks become points in space. Each view uses the
    points it sees (more than half of the light reaches them); if it sees no positive one, it uses a point on
    which earlier views agree, which finds the far side of an object. A mask that contradicts earlier views
    has no vote. An outline becomes a cone in space, which crops all masks.

    Args:
        model: of any stage; masks are found in its own colours and textures.
        clicks: on a view of it.
        cameras: of the other views, on the model's device.
        masks: finds the object in a view.
        light: in all views.
        vote: how masks become surfels; "centre" is the paper's way, of the masks that have a vote here.
        threshold: of the votes; by default 0.5 of contributions, 0.7 of views.
        connected: whether only the connected components that hold a positive click are kept.
        title: of the progress bar.
    """
    camera, find = clicks.camera, partial(view_mask, model, masks=masks, light=light)
    reference = find(clicks)
    held = torch.ones_like(model.parameters["opacities"])  # share inside the outline's cone
    if clicks.held is not None:
        (cone := CentreVotes(model)).add(camera, clicks.held)
        held, clicks = cone.inside, with_middles(clicks, reference)
    places, used = places_of(model, clicks), 1  # views
    votes = (ContributionVotes if vote == "contribution" else CentreVotes)(model, threshold)
    so_far = votes if isinstance(votes, ContributionVotes) else ContributionVotes(model, rounds=0)
    counted = [votes] if so_far is votes else [votes, so_far]
    for each in counted:
        each.add(camera, reference)
    outwards = sorted(cameras, key=lambda other: -float(camera.viewmat[2, :3] @ other.viewmat[2, :3]))
    for other in progress(outwards, title=title, unit="view"):
        mask = _mask(find, so_far, held, places, clicks.positive, other)
        if mask is not None:
            for each in counted:
                each.add(other, mask)
            used += 1
    selected = votes.selected()
    if not bool(selected.any()):
        raise ArgumentError(
            f"segment: expected surfels that most masks of {used} views hold, got none; click elsewhere on "
            "the object, or lower the threshold"
        )
    if connected:
        selected = components_at(model, selected, places[clicks.positive])
    return Lifted(selected, reference, used, 1 + len(cameras) - used)


@torch.no_grad()
def view_mask(model: Surfels, clicks: Clicks, masks: MaskModel, light: Light) -> Tensor:
    """Return the mask [H, W] bool of a view, of what the model shows there; clicks outside are dropped.

    The mask model sees a crop around the visible part, so that the object is larger.
    """
    camera = clicks.camera
    box = screen_box(model.parameters, model.shading.options, camera).within(camera.width, camera.height)
    cut = camera.crop(*box)
    shown = model.render(cut, light)
    image = shown.color.clamp(0, 1)
    moved = clicks.points.to(image) - image.new_tensor(box[:2])
    inside = (moved >= 0).all(1) & (moved < moved.new_tensor([cut.width, cut.height])).all(1)
    mask = torch.zeros(camera.height, camera.width, dtype=torch.bool, device=image.device)
    part = slice(box.top, box.bottom), slice(box.left, box.right)
    is_shown = shown.alpha >= FAINT
    held = None if clicks.held is None else clicks.held[part] & is_shown
    if held is not None or bool(clicks.positive[inside].any()):
        chosen = masks(image, moved[inside], clicks.positive[inside], held, is_shown)
        mask[part] = chosen & (is_shown if held is None else held)
    return mask


def _mask(
    find: Find, so_far: ContributionVotes, held: Tensor, places: Tensor, positive: Tensor, camera: Camera
) -> Tensor | None:
    """Return the mask of a view, or None if it misses the object or contradicts earlier views."""
    values = torch.stack([so_far.seen.float(), so_far.shares, held], dim=1)
    shown = so_far.shown(camera, values, ("median",))
    (has_votes, is_object, is_held), alpha = shown.color.unbind(2), shown.alpha
    pixels, depths = camera.project(places)
    seen = is_visible(pixels, depths, shown.median, TOLERANCE * extent(so_far.model))  # type: ignore[arg-type]
    points, positive = pixels[seen], positive[seen]
    if not bool(positive.any()):
        inner = middle_of((is_object > CERTAIN_SHARE * alpha) & (alpha > 0.5))
        if inner is None:
            return None
        points = torch.cat([points, points.new_tensor([inner])])
        positive = torch.cat([positive, positive.new_ones(1)])
    mask = find(Clicks(camera, points, positive)) & (is_held >= 0.5 * alpha)
    known = has_votes > 0.5 * alpha.clamp_min(1e-6)
    expected = (is_object > 0.5 * has_votes) & known
    overlap = (mask & expected).sum() / (mask & known | expected).sum().clamp_min(1)
    return mask if bool(mask.any()) and float(overlap) >= AGREEMENT else None


def with_middles(clicks: Clicks, mask: Tensor) -> Clicks:
    """Add the middles of the larger pieces of the mask [H, W] to clicks, for other views."""
    from scipy.ndimage import label

    numbers, count = label(mask.cpu().numpy())
    pieces = [torch.from_numpy(numbers == 1 + index) for index in range(count)]
    least = PIECE_SHARE * max((int(piece.sum()) for piece in pieces), default=0)
    middles = clicks.points.new_tensor([middle_of(piece) for piece in pieces if int(piece.sum()) >= least])
    positive = torch.cat([clicks.positive, clicks.positive.new_ones(len(middles))])
    return replace(clicks, points=torch.cat([clicks.points, middles]), positive=positive)


def middle_of(mask: Tensor) -> tuple[float, float] | None:
    """Return the pixel of a mask [H, W] farthest from its outline, or None if the mask is empty."""
    from scipy.ndimage import distance_transform_edt

    if not bool(mask.any()):
        return None
    distances = distance_transform_edt(mask.cpu().numpy())
    row, column = divmod(int(distances.argmax()), mask.shape[1])
    return column + 0.5, row + 0.5


def components_at(model: Surfels, mask: Tensor, places: Tensor) -> Tensor:
    """Return the connected components of a non-empty segment [N] bool that contain points [P, 3].

    Of several similar objects this keeps only the one clicked on. Two surfels touch if their means are within
    2 standard deviations (the larger ones) of both together. A point belongs to the component of the nearest
    surfel of the segment.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    chosen = mask.nonzero()[:, 0]
    means, count = model.parameters["means"][chosen], len(chosen)
    reach = TOUCH_SIGMAS * model.parameters["scales"][chosen].detach().exp().amax(dim=1).cpu().numpy()
    found = nearest(means, means, min(NEIGHBOURS, count - 1) + 1)
    distances, others = (x.numpy() for x in found)
    rows = np.repeat(np.arange(count), others.shape[1])
    touches = distances.ravel() <= reach[rows] + reach[np.minimum(others.ravel(), count - 1)]
    edges = (np.ones(int(touches.sum())), (rows[touches], others.ravel()[touches]))
    _, component = connected_components(coo_array(edges, shape=(count, count)), directed=False)
    _, clicked = nearest(means, places)
    kept = torch.from_numpy(np.isin(component, component[clicked.numpy()])).to(mask.device)
    result = torch.zeros_like(mask)
    result[chosen[kept]] = True
    return result
