"""Votes of masks against known classes of surfels."""

from dataclasses import replace

import torch
from torch.nn.functional import interpolate

from tests.edit.lift_scenes import cameras, nested, overlap, truth, two_balls
from texgs.edit.votes import CentreVotes, ContributionVotes
from texgs.fields.splats import geometry
from texgs.raster import Options
from texgs.raster.reference import rasterize as reference


def noisy(mask, seed):
    """A mask whose outline wanders by pixels, and in which a spot is wrong now and then."""
    generator = torch.Generator().manual_seed(seed)
    waves = interpolate(torch.randn(1, 1, 12, 12, generator=generator), mask.shape, mode="bicubic")[0, 0]
    soft = torch.nn.functional.avg_pool2d(mask[None, None].float(), 5, 1, 2)[0, 0]
    return soft + 0.2 * waves > 0.5


def counted(votes, model, of_class, change=lambda mask, seed: mask):
    """Selected surfels [N], and the weights [N] of all surfels in all views."""
    total = torch.zeros(len(model))
    for seed, camera in enumerate(cameras()):
        mask, weights = truth(model, of_class, camera)
        votes.add(camera, change(mask, seed))
        total += weights
    return votes.selected(), total


def test_opaque_objects_are_told_apart():
    model, numbers = two_balls()
    selected, weights = counted(ContributionVotes(model), model, numbers == 0, noisy)
    assert overlap(selected, numbers == 0, weights) > 0.97


def test_a_ball_seen_through_a_shell_is_told_apart_better_than_by_centres():
    model, numbers = nested()
    by_weight, weights = counted(ContributionVotes(model), model, numbers > 0, noisy)
    by_centre, _ = counted(CentreVotes(model), model, numbers > 0, noisy)
    plain, _ = counted(ContributionVotes(model, rounds=0), model, numbers > 0, noisy)
    iou = overlap(by_weight, numbers > 0, weights)
    assert iou >= 0.95
    assert iou > overlap(by_centre, numbers > 0, weights) + 0.02
    assert iou > overlap(plain, numbers > 0, weights)


def test_shares_are_sums_over_fragments():
    """The gradient of the float64 reference's image with respect to one channel of colour is the oracle."""
    model, _ = two_balls(n=40)
    camera = cameras(size=24)[7]
    mask = torch.rand(24, 24, generator=torch.Generator().manual_seed(0))
    votes = ContributionVotes(model, rounds=0)
    votes.add(camera, mask)
    features = torch.ones(80, 1, dtype=torch.float64, requires_grad=True)
    exact = [x.double() for x in geometry(model.parameters)]
    lens = (camera.viewmat.double(), camera.K.double(), 24, 24)
    image = reference(*exact, *lens, features=features, options=Options(low_pass=6.0)).color[..., 0]
    sums = torch.autograd.grad((image * mask).sum(), features, retain_graph=True)[0][:, 0]
    weights = torch.autograd.grad(image.sum(), features)[0][:, 0]
    seen = weights > 0.05
    assert seen.sum() > 20
    torch.testing.assert_close(votes.shares[seen].double(), (sums / weights)[seen], atol=2e-3, rtol=0)


def test_surfels_that_no_view_shows_follow_their_neighbours():
    model, numbers = two_balls()
    hidden = torch.zeros(len(model), dtype=torch.bool)
    hidden[[3, 700, 1600, 2900]] = True
    opacities = torch.where(hidden, -20.0, model.parameters["opacities"])
    unseen = type(model)({**model.parameters, "opacities": opacities}, model.shading)
    selected, _ = counted(ContributionVotes(unseen), unseen, numbers == 0)
    assert selected[hidden].tolist() == [True, True, False, False]


def test_centres_vote_as_counted_by_hand():
    """Of ten views with the same camera, masks hold the first ball in `inside` of them."""
    model, _ = two_balls(n=30)
    camera = cameras()[20]
    everywhere = torch.ones(96, 96, dtype=torch.bool)
    for inside, expected in ((7, False), (8, True)):  # more than 0.7 of all views are needed
        votes = CentreVotes(model)
        for view in range(10):
            votes.add(camera, everywhere & (view < inside))
        assert bool(votes.selected().all()) is expected
    turned = replace(camera, viewmat=torch.diag(torch.tensor([-1.0, 1, -1, 1])) @ camera.viewmat)
    for away in (camera.crop(200, 0, 296, 96), turned):  # it sees nothing: votes -1
        half = CentreVotes(model, threshold=0.4)
        for view in range(10):
            half.add(camera if view < 5 else away, everywhere)
        assert not half.selected().any(), "5 of 10 views are no majority"


def test_nothing_is_selected_where_masks_are_empty():
    model, _ = two_balls(n=30)
    for votes in (ContributionVotes(model), CentreVotes(model)):
        assert not votes.selected().any()
        votes.add(cameras()[0], torch.zeros(96, 96, dtype=torch.bool))
        assert not votes.selected().any()
