"""Consistency of views of a plane, whose depth and colours are known in closed form."""

from dataclasses import replace
from math import sqrt

import pytest
import torch

from tests.edit.lift_scenes import two_balls
from tests.fields.voxels.test_voxels import ball as voxel_ball
from tests.refusals import refused
from texgs.core.camera import Camera, intrinsics, look_at, orbit
from texgs.core.errors import ShapeError
from texgs.core.light import Light
from texgs.fields.surfels.composition import Composition
from texgs.fields.voxels import VoxelScene
from texgs.metrics.consistency import OPAQUE_ALPHA, TOLERANCE, SeenFrame, difference, mean_differences, warp

SIZE = 64


def camera(x, y=0.0, z=-2.0, target=None):
    """Looks along +z with y down, unless at a target."""
    place = torch.tensor([x, y, z])
    towards = place + torch.tensor([0.0, 0.0, 1.0]) if target is None else torch.tensor(target)
    return Camera(look_at(place, towards), intrinsics(40, SIZE, SIZE), SIZE, SIZE)


def color(places):
    """Smooth colours of the plane z = 0."""
    x, y = places[..., 0], places[..., 1]
    return torch.stack([0.5 + 0.3 * x, 0.5 - 0.2 * y, 0.5 + 0.2 * torch.sin(3 * x + 2 * y)], dim=-1)


def plane(view, half=0.4):
    """The square |x|, |y| < half of the plane z = 0 seen by a camera, by ray casting in float64."""
    at = torch.arange(SIZE) + 0.5
    y, x = torch.meshgrid(at, at, indexing="ij")
    rays = torch.stack([x, y, torch.ones_like(x)], -1).double() @ torch.linalg.inv(view.K.double()).T
    R = view.viewmat[:3, :3].double()
    depth = -view.position.double()[2] / (rays @ R)[..., 2]
    places = view.position.double() + depth[..., None] * (rays @ R)
    alpha = (places[..., :2].abs() < half).all(-1)
    image = torch.where(alpha[..., None], color(places), 1.0)
    return SeenFrame(image.float(), torch.where(alpha, depth, 0).float(), alpha.float(), view)


def consistency(frames, apart=1, tolerance=TOLERANCE):
    """What all pairs of frames so far apart make: the root of their mean squared difference."""
    pairs = zip(frames, frames[apart:], strict=False)
    rmse, distance = mean_differences([difference(*pair, tolerance=tolerance) for pair in pairs])
    assert distance is None
    return rmse


def covered(frames, apart=1, tolerance=TOLERANCE):
    """The smallest share of the pixels of an object that such a pair compares."""
    pairs = zip(frames, frames[apart:], strict=False)
    return min(float(warp(b, a, tolerance)[1].sum() / (a.alpha >= OPAQUE_ALPHA).sum()) for a, b in pairs)


def frames_of(scene, cameras, light, depth="median", **more):
    """Rendered frames, with the scene's own depth."""
    for view in cameras:
        shown = scene.render(view, light, outputs=(depth,), **more)
        yield SeenFrame(shown.color.clamp(0, 1), getattr(shown, depth), shown.alpha, view)


def test_a_textured_plane_is_consistent():
    frames = [plane(camera(0.3 * i - 0.6, 0.1 * i, target=(0.0, 0.0, 0.0))) for i in range(5)]
    for apart in (1, 3):
        assert consistency(frames, apart) < 2e-4, "but for what interpolation between pixels loses"
        assert covered(frames, apart) > 0.8


def test_colours_that_change_with_the_view_are_measured():
    """An offset of one view shows in both pairs that it is in: (0.1, 0.1, 0)."""
    frames = [plane(camera(0.02 * i)) for i in range(4)]
    frames[1] = replace(frames[1], image=frames[1].image + 0.1)
    assert consistency(frames) == pytest.approx(0.1 * sqrt(2 / 3), abs=1e-4)
    assert consistency(frames, 2) == pytest.approx(0.1 * sqrt(1 / 2), abs=1e-4)


def test_noise_of_views_is_measured():
    """Moved by whole pixels nothing is interpolated: the difference of two noises of deviation 0.05."""
    step = 3 * 2.0 / float(intrinsics(40, SIZE, SIZE)[0, 0])
    generator = torch.Generator().manual_seed(0)
    frames = [plane(camera(step * i)) for i in range(4)]
    noises = 0.05 * torch.randn(4, SIZE, SIZE, 3, generator=generator)
    noisy = [replace(frame, image=frame.image + noise) for frame, noise in zip(frames, noises, strict=True)]
    assert consistency(frames) < 1e-5
    assert consistency(noisy) == pytest.approx(0.05 * sqrt(2), rel=0.02)


def test_what_is_hidden_is_not_compared():
    """A near square of another colour hides part of the plane in one view, another part in the other."""
    frames = []
    for x in (-0.2, 0.2):
        back, front = plane(camera(x)), plane(camera(x, z=-1.0), half=0.1)  # 1 nearer, colours of its own
        is_front = front.alpha > 0.5
        image = torch.where(is_front[..., None], torch.tensor([0.0, 0.0, 1.0]), back.image)
        frames.append(replace(back, image=image, depth=torch.where(is_front, front.depth, back.depth)))
    warped, same = warp(frames[1], frames[0])
    assert same.any()
    assert (warped - frames[0].image)[same].abs().max() < 0.01
    assert not same.all()


def test_a_perceptual_distance_sees_only_what_is_compared():
    frames, seen = [plane(camera(0.1 * i)) for i in range(2)], []

    def distance(image, where):
        seen.append((image, where))
        return 0.25

    measured = difference(*frames, distance)
    assert measured.distance == 0.25
    ((image, where),) = seen
    warped, same = warp(frames[1], frames[0])
    assert torch.equal(where, same)
    assert torch.equal(image[~same], frames[0].image[~same])
    assert torch.equal(image[same], warped[same])
    assert (image != frames[0].image).any()


def test_a_scene_is_consistent_without_light_and_less_so_under_a_light_that_moves():
    """Opaque shells of one colour: without light all views agree, under a headlight shading moves along."""
    scene = Composition([two_balls(opacity=0.999)[0]])
    views = [orbit(-90 + 6 * i, 10, 4.0, 22.0, 96, 96) for i in range(4)]
    light = Light("headlight")
    unlit = list(frames_of(scene, views, light, look="unshaded"))
    flat = consistency(unlit, tolerance=0.005)
    assert covered(unlit, tolerance=0.005) > 0.5
    assert flat < 0.03
    assert consistency(list(frames_of(scene, views, light)), tolerance=0.005) > flat


def test_voxels_are_compared_by_their_mean_depth():
    scene = VoxelScene([voxel_ball(density=500.0)])
    views = [orbit(-90 + 3 * i, 10, 2.0, 22.0, 64, 64) for i in range(4)]
    frames = list(frames_of(scene, views, Light("headlight"), depth="depth"))
    assert covered(frames, tolerance=0.02) > 0.5
    assert consistency(frames, tolerance=0.02) < 0.01
    refused(lambda: list(frames_of(scene, views, Light("headlight"))), "median")


def test_frames_that_cannot_be_compared():
    frames = [plane(camera(0.0)), plane(camera(0.02))]
    away = plane(camera(5.0, target=(5.0, 0.0, 0.0)))
    assert difference(frames[0], away) is None, "they see nothing that is the same"
    refused(
        lambda: difference(frames[0], replace(frames[1], depth=frames[1].depth[:, 1:])),
        r"depth: .*\[64, 63\]",
        ShapeError,
    )
