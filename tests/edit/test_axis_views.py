"""Six views along the axes."""

from dataclasses import replace

import pytest
import torch
from torch.testing import assert_close

from tests.real_data import real_data
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError
from texgs.edit.axis_views import AXES, axis_cameras, choose_axis_views
from texgs.volume.cameras import icosphere, orbit_path
from texgs.volume.view_set import read_views


def directions(cameras, center=0.0):
    return {
        name: (camera.position - center) / (camera.position - center).norm()
        for name, camera in cameras.items()
    }


@pytest.mark.parametrize("frequency", [1, 2, 3, 5])
def test_chosen_views_are_the_nearest_to_their_axes_in_any_order(frequency):
    cameras = icosphere(frequency, 4.0, 30, 8, 8)
    shuffled = [cameras[i] for i in torch.randperm(len(cameras), generator=torch.Generator().manual_seed(1))]
    chosen = choose_axis_views(shuffled)
    assert list(chosen) == list(AXES)
    assert len(set(chosen.values())) == 6
    for name, index in chosen.items():
        axis = torch.tensor(AXES[name])
        cosines = [float(camera.position @ axis / camera.position.norm()) for camera in shuffled]
        assert cosines[index] >= max(cosines) - 1e-5


def test_chosen_views_depend_on_the_center():
    cameras = list(
        axis_cameras(orbit(10, 20, 3.0, 40, 8, 8), torch.tensor([[1.0, 0, 0], [1.2, 0.1, 0.1]])).values()
    )
    center = torch.tensor([1.1, 0.05, 0.05])
    assert list(choose_axis_views(cameras, center).values()) == list(range(6))


def test_a_ring_of_cameras_has_no_top():
    with pytest.raises(ArgumentError, match=r"within 45 degrees of the top view, got one at 90; make views"):
        choose_axis_views(orbit_path(12, 0, 3.0, 40, 8, 8))


def test_few_cameras():
    with pytest.raises(ArgumentError, match="front view, got none"):
        choose_axis_views([])


def test_the_published_views_have_all_six():
    views = read_views(real_data("vortex/TF01"))
    chosen = choose_axis_views([view.camera for view in views.train])
    found = directions({name: views.train[index].camera for name, index in chosen.items()})
    for name, axis in AXES.items():
        assert float(found[name] @ torch.tensor(axis)) > 0.9


@pytest.mark.parametrize("size", [(64, 64), (96, 40), (30, 80)])
def test_made_views_look_along_the_axes_and_are_filled_by_the_scene(size):
    points = (
        torch.rand(500, 3, generator=torch.Generator().manual_seed(0)) * torch.tensor([1.0, 0.4, 0.6]) + 0.3
    )
    like = replace(orbit(33, 44, 3.0, 40, 64, 64), width=size[0], height=size[1])
    cameras = axis_cameras(like, points)
    center = (points.amin(dim=0) + points.amax(dim=0)) / 2
    for name, direction in directions(cameras, center).items():
        assert_close(direction, torch.tensor(AXES[name]), atol=1e-5, rtol=0)
    fullest = 0.0
    for camera in cameras.values():
        assert (camera.width, camera.height) == size
        assert_close((camera.position - center).norm(), (like.position - center).norm(), atol=1e-4, rtol=1e-4)
        local = points @ camera.viewmat[:3, :3].T + camera.viewmat[:3, 3]
        pixels = (local @ camera.K.T)[:, :2] / local[:, 2:]
        relative = (pixels / torch.tensor(size) - 0.5).abs().max()
        assert relative < 0.5
        fullest = max(fullest, float(relative))
    assert fullest > 0.45


def test_top_and_bottom_are_upright():
    """Going up from the front, the scene's front is below in the image: no turn on the way."""
    cameras = axis_cameras(orbit(0, 0, 3.0, 40, 10, 10), torch.eye(3))
    assert_close(cameras["top"].viewmat[1, :3], torch.tensor([0.0, 0.0, 1.0]), atol=1e-6, rtol=0)
    assert_close(cameras["front"].viewmat[1, :3], torch.tensor([0.0, -1.0, 0.0]), atol=1e-6, rtol=0)


def test_a_camera_inside_of_the_scene():
    with pytest.raises(ArgumentError, match="expected a camera well outside of the scene"):
        axis_cameras(orbit(0, 0, 0.5, 40, 8, 8), torch.tensor([[-1.0, -1, -1], [1, 1, 1]]))
