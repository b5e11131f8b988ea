"""Registered motion against volumes that were moved by a known one."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from texgs.volume import motion as motions
from texgs.volume.grid import Grid
from texgs.volume.motion import Motion, motion
from texgs.volume.transfer import TransferFunction

TF = TransferFunction(((0.2, 0), (0.5, 0.5), (1, 0.9)), ((0, 1, 1, 1),))


def blob(center, sizes=(40, 36, 32), width=0.12, scale=1.0):
    """A ball at a place x, y, z in world units, on a lattice of x, y, z samples, some longer than others."""
    spacing = (1.0, 1.5, 2.0)
    grid = Grid(np.zeros(sizes[::-1], np.float32), spacing)
    axes = [np.linspace(-end, end, size) for end, size in zip(grid.aabb[1], sizes, strict=True)]
    z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
    square = (x - center[0]) ** 2 + (y - center[1]) ** 2 + (z - center[2]) ** 2
    return Grid(scale * np.exp(-square / (2 * width**2)).astype(np.float32), spacing)


@pytest.mark.parametrize("most", [96, 24])
def test_a_ball_that_moved_is_found_along_all_axes(monkeypatch, most):
    monkeypatch.setattr(motions, "MAX_SIDE", most)
    way = torch.tensor([0.05, -0.03, 0.04])
    moves = motion(blob((0, 0, 0)), blob(way.tolist()), TF)
    shell = 0.15 * torch.nn.functional.normalize(
        torch.randn(200, 3, generator=torch.Generator().manual_seed(0)), dim=1
    )
    found = moves.at(shell)
    normals = shell / 0.15
    along = (found * normals).sum(1), (way * normals).sum(1)  # sliding along a level cannot be seen
    torch.testing.assert_close(*along, atol=0.006, rtol=0)
    torch.testing.assert_close(found.mean(0), way, atol=0.012, rtol=0)


def test_a_ball_that_grows_moves_its_surface_outwards():
    moves = motion(blob((0, 0, 0), width=0.10), blob((0, 0, 0), width=0.12), TF)
    level = 0.12 * torch.eye(3)
    torch.testing.assert_close(moves.at(level), 0.2 * level, atol=0.006, rtol=0)


def test_what_does_not_move_stays():
    still = motion(blob((0, 0, 0)), blob((0, 0, 0)), TF)
    assert float(still.displacements.abs().max()) < 1e-5


def test_displacements_are_linear_between_points_and_constant_beyond():
    displacements = torch.zeros(2, 2, 3, 3)
    displacements[..., 0] = torch.tensor([0.0, 1.0, 2.0])  # along x
    moves = Motion(displacements, torch.tensor([0.0, 0, 0]), torch.tensor([4.0, 1, 1]))
    points = torch.tensor([[0.0, 0, 0], [1, 0.5, 0.2], [4, 1, 1], [9, 0, 0], [-3, 0, 0]])
    torch.testing.assert_close(moves.at(points)[:, 0], torch.tensor([0.0, 0.5, 2.0, 2.0, 0.0]))


def test_missing_samples_do_not_spread():
    before = blob((0, 0, 0))
    after = blob((0.04, 0, 0))
    after.values[:3] = np.nan
    moves = motion(before, after, TF)
    assert bool(moves.displacements.isfinite().all())
    assert float(moves.at(torch.tensor([[0.15, 0, 0]]))[0, 0]) == pytest.approx(0.04, abs=0.01)


def test_the_channel_of_the_function_moves():
    still, way = blob((0, 0, 0)), (0.08, 0, 0)
    before = replace(still, others=(still.values,))
    after = replace(still, others=(blob(way).values,))
    moves = motion(before, after, replace(TF, channel=1))
    assert float(moves.at(torch.tensor([[0.12, 0.0, 0.0]]))[0, 0]) > 0.06
    assert float(motion(before, after, TF).displacements.abs().max()) < 1e-5
