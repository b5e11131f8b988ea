"""Select surfels by masks of views: two ways of counting votes."""

from collections.abc import Collection
from typing import Literal

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.geometry import nearest
from texgs.fields.splats import geometry
from texgs.fields.surfels.model import Surfels
from texgs.raster import Render, splat

Vote = Literal["contribution", "centre"]
VOTING_PIXELS = 0.01  # least weight of a surfel in all views together, in pixels, to have a vote
ROUNDS = 5
NEIGHBOURS = 5  # seen surfels whose mean share an unseen one takes


class ContributionVotes:
    """Each pixel votes for its surfels, weighted by their share of the pixel.

    A surfel's share is sum(weight * mask) / sum(weight) over all pixels of all views, weight being its
    blending weight there: the adjoint of rendering. What is hidden in a view has no vote in it, and what
    shows little has little. Where a surfel shares its pixels with others, the share is too much of a mean:
    then shares are rendered, and what pixels lack of their masks, or have too much, is voted on. Such rounds
    are the simultaneous iterative reconstruction of tomography (Gilbert 1972), of which plain votes are the
    first step; they move towards the least-squares solution, and few of them do not yet fit the noise of
    masks.

    A surfel that no view shows gets the mean share of its nearest neighbours. More than the threshold, 1/2 by
    default, belongs to the object. Without rounds of votes on what is left, votes are plain.
    """

    def __init__(self, model: Surfels, threshold: float | None = None, rounds: int = ROUNDS) -> None:
        self.model, self.rounds = model, rounds
        self.threshold = 0.5 if threshold is None else threshold
        self.sums, self.weights = model.parameters["means"].new_zeros(2, len(model))
        self.views: list[tuple[Camera, Tensor]] = []

    @torch.no_grad()
    def add(self, camera: Camera, mask: Tensor) -> None:
        """Count the mask [H, W], bool or in [0, 1], of a view."""
        mask = mask.to(self.sums)
        sums, weights = self._splat(camera, mask)
        self.sums += sums
        self.weights += weights
        if self.rounds:
            self.views.append((camera, mask))

    @property
    def seen(self) -> Tensor:
        """Return the surfels [N] bool that have votes."""
        return self.weights > VOTING_PIXELS

    @property
    def shares(self) -> Tensor:
        """Return the share [N] of each surfel's votes for the object, before rounds; 0 without votes."""
        return torch.where(self.seen, self.sums / self.weights.clamp_min(VOTING_PIXELS), 0.0)

    @torch.no_grad()
    def refined(self) -> Tensor:
        """Return the shares [N] after all rounds."""
        shares = self.shares
        for _ in range(self.rounds):
            change = torch.zeros_like(shares)
            for camera, mask in self.views:
                shown = self.shown(camera, shares[:, None])
                mean = shown.color[..., 0] / shown.alpha.clamp_min(1e-6)
                change += self._splat(camera, mask - mean)[0]
            shares = (shares + change / self.weights.clamp_min(VOTING_PIXELS)).clamp(0, 1)
        return shares

    def selected(self) -> Tensor:
        """Return the surfels [N] bool that belong to the object."""
        shares, seen = self.refined(), self.seen
        if bool(seen.any()) and not bool(seen.all()):
            means, count = self.model.parameters["means"], min(NEIGHBOURS, int(seen.count_nonzero()))
            _, neighbours = nearest(means[seen], means[~seen], count)
            shares[~seen] = shares[seen][neighbours.to(shares.device)].mean(1)
        return shares > self.threshold

    def shown(self, camera: Camera, values: Tensor, outputs: Collection[str] = ()) -> Render:
        """Render values [N, C] of surfels over 0."""
        return self.model.rasterized(camera, features=values, outputs=outputs)

    def _splat(self, camera: Camera, image: Tensor) -> tuple[Tensor, Tensor]:
        """Return sums [N] of weight * image [H, W], and sums [N] of weights."""
        planes, options = image[..., None].contiguous(), self.model.shading.options
        lens = camera.viewmat, camera.K
        sums, weights = splat(planes, *geometry(self.model.parameters), *lens, options=options)
        return sums[:, 0], weights


class CentreVotes:
    """Each view votes once for each surfel, by the pixel that its mean projects to: the paper's way.

    A surfel is 1 or 0 as the mask there, -1 outside of the view; neither size nor opacity nor what is in
    front of it counts. It belongs to the object if 1 is the most frequent of all views, and of a larger share
    of them than the threshold, 0.7 by default (Hu et al. 2024, SAGD).
    """

    def __init__(self, model: Surfels, threshold: float | None = None) -> None:
        self.means, self.views = model.parameters["means"], 0
        self.threshold = 0.7 if threshold is None else threshold
        self.inside, self.outside = self.means.new_zeros(2, len(model))

    def add(self, camera: Camera, mask: Tensor) -> None:
        """Count the mask [H, W] of a view."""
        pixels, depths = camera.project(self.means)
        x, y = pixels.floor().unbind(1)
        is_there = (depths > 0) & (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
        x, y = (torch.where(is_there, at, 0.0).long() for at in (x, y))
        is_in = mask.to(self.means.device)[y, x] > 0.5
        self.inside += is_there & is_in
        self.outside += is_there & ~is_in
        self.views += 1

    def selected(self) -> Tensor:
        """Return the surfels [N] bool that belong to the object."""
        absent = self.views - self.inside - self.outside
        is_mode = (self.inside > self.outside) & (self.inside > absent)
        return is_mode & (self.inside > self.threshold * self.views)
