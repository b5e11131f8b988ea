import math

import pytest
import torch
from scipy.spatial.transform import Rotation

from texgs.fields.optimizer import Optimizer, Rate
from texgs.fitting.densify import RESET_OPACITY, SHRINK_FACTOR, DensityControl
from texgs.fitting.settings import Densify

from .scenes import logit

EXTENT = 2.0
SMALL, LARGE = 0.01, 0.1  # scales below and above `size` x extent = 0.02


def settings(**options):
    defaults = {"start": 0, "stop": 100, "every": 10, "threshold": 2e-4, "size": 0.01, "cap": 1000}
    return Densify(**{**defaults, "prune_opacity": 0.005, "prune_size": 0.1, **options})


def surfels(scales, opacities=None):
    """One surfel for each scale, along x, each with a colour that tells which it is."""
    n = len(scales)
    turn = torch.tensor([math.cos(0.5), 0.0, math.sin(0.5), 0.0])
    return Optimizer(
        {
            "means": torch.arange(n, dtype=torch.float32)[:, None] * torch.tensor([1.0, 0.0, 0.0]),
            "quats": turn.repeat(n, 1),
            "scales": torch.tensor(scales).log()[:, None].repeat(1, 2),
            "opacities": torch.tensor([logit(o) for o in opacities or [0.5] * n]),
            "colors": torch.arange(n, dtype=torch.float32)[:, None].repeat(1, 3),
            "ambient": torch.zeros(1),
        },
        {"ambient": Rate(1.0, 1.0)},
    )


def control_of(optimizer, gradients, **options):
    """Statistics as if each surfel had had this mean gradient, in half image widths."""
    control = DensityControl(settings(**options), len(gradients), EXTENT, torch.device("cpu"))
    control.gradients, control.counts = torch.tensor(gradients) * 3, torch.full((len(gradients),), 3.0)
    return control


def step(optimizer, gradients, iteration=10, seed=0, **options):
    """The colours, which name the surfels if they have any, after a step."""
    control = control_of(optimizer, gradients, **options)
    control.step(iteration, optimizer, torch.Generator().manual_seed(seed))
    return optimizer.parameters.get("colors", torch.zeros(0, 3))[:, 0].tolist()


def test_gradients_count_in_half_image_widths_and_only_where_there_are_any():
    control = DensityControl(settings(), 2, EXTENT, torch.device("cpu"))
    control.observe(torch.tensor([[3e-6, 0.0], [0.0, 0.0]]), 200, 80)
    control.observe(torch.tensor([[0.0, 1e-6], [0.0, 2e-6]]), 200, 80)
    torch.testing.assert_close(control.gradients, torch.tensor([3e-4 + 4e-5, 8e-5]))
    assert control.counts.tolist() == [2, 1]


def test_small_surfels_above_the_threshold_are_cloned():
    optimizer = surfels([SMALL] * 3)
    assert step(optimizer, [1e-4, 3e-4, 2e-4]) == [0, 1, 2, 1]
    for x in optimizer.parameters.values():
        if len(x) == 4:
            assert torch.equal(x[3], x[1])
    assert optimizer.parameters["ambient"].shape == (1,)


def test_large_surfels_above_the_threshold_are_split():
    optimizer = surfels([LARGE, SMALL, LARGE])
    assert step(optimizer, [1e-3, 0.0, 0.0]) == [1, 2, 0, 0]
    p = optimizer.parameters
    torch.testing.assert_close(p["scales"][2:].exp(), torch.full((2, 2), LARGE / SHRINK_FACTOR))
    normal = torch.tensor([math.sin(1.0), 0.0, math.cos(1.0)])  # z turned by 1 radian about y
    torch.testing.assert_close(p["means"][2:] @ normal, torch.zeros(2), atol=1e-6, rtol=0)
    assert not torch.equal(p["means"][2], p["means"][3])
    alone = surfels([LARGE])
    step(alone, [1e-3])
    assert (len(alone.parameters["means"]), len(alone.parameters["ambient"])) == (2, 1), "one material"


@pytest.mark.parametrize("deviations", [(0.1, 0.05), (0.1, 0.05, 0.2)], ids=["surfels", "Gaussians"])
def test_children_are_drawn_from_their_parent(deviations):
    n, quat, scales = 4000, torch.tensor([0.9, 0.1, -0.3, 0.2]), torch.tensor(deviations)
    rows = {"means": torch.zeros(n, 3), "opacities": torch.zeros(n), "sh": torch.zeros(n, 1, 3)}
    shape = {"quats": quat.repeat(n, 1), "scales": scales.log().repeat(n, 1)}
    optimizer = Optimizer({**rows, **shape}, {"sh": Rate(1.0, 1.0)})
    step(optimizer, [1.0] * n, cap=2 * n)
    p = optimizer.parameters
    assert len(p["means"]) == 2 * n
    torch.testing.assert_close(p["scales"][0].exp(), scales / SHRINK_FACTOR)
    axes = torch.from_numpy(Rotation.from_quat(quat.double().numpy(), scalar_first=True).as_matrix())
    axes = axes[:, : len(deviations)]
    covariance = axes @ torch.diag(scales.double() ** 2) @ axes.T
    # The error of a standard deviation from 8000 draws is 0.8 %, of a variance twice that.
    torch.testing.assert_close(p["means"].detach().double().T.cov(), covariance, atol=1.6e-3, rtol=0)


def test_faint_and_huge_surfels_are_removed_and_not_cloned():
    optimizer = surfels([SMALL, SMALL, 0.3, SMALL], [0.5, 0.004, 0.5, 0.006])  # prune_size x extent = 0.2
    assert step(optimizer, [0.0, 1.0, 1.0, 0.0]) == [0, 3]


def test_huge_surfels_stay_until_the_iteration_from_which_sizes_count():
    for iteration, left in ((10, [0, 1]), (20, [0, 1]), (30, [0])):
        assert step(surfels([SMALL, 0.3]), [0.0, 0.0], iteration, prune_size_from=20) == left


def test_without_a_cap_all_above_the_threshold_are_cloned():
    assert step(surfels([SMALL] * 3), [4e-4, 1e-4, 3e-4], cap=None) == [0, 1, 2, 0, 2]


def test_the_cap_takes_the_largest_gradients():
    assert step(surfels([SMALL] * 4), [4e-4, 9e-4, 3e-4, 8e-4], cap=6) == [0, 1, 2, 3, 1, 3]
    assert sorted(step(surfels([LARGE] * 4), [4e-4, 9e-4, 3e-4, 8e-4], cap=5)) == [0, 1, 1, 2, 3]


@pytest.mark.parametrize(
    ("opacities", "cap", "left"),
    [
        (None, 1, [0, 1, 2, 3]),
        (None, 3, [0, 1, 2, 3]),
        (None, 4, [0, 1, 2, 3]),
        ([0.5, 0.001, 0.5, 0.5], 4, [0, 2, 3, 3]),
    ],
)
def test_only_what_is_removed_makes_room_at_or_above_the_cap(opacities, cap, left):
    assert step(surfels([SMALL, LARGE, SMALL, SMALL], opacities), [1e-3, 0.5, 2e-3, 3e-3], cap=cap) == left


@pytest.mark.parametrize(("iteration", "expected"), [(9, 2), (10, 2), (20, 3), (30, 3), (40, 2)])
def test_it_happens_every_so_often_after_start_and_up_to_stop(iteration, expected):
    optimizer = surfels([SMALL] * 2)
    assert len(step(optimizer, [1.0, 0.0], iteration, start=10, stop=30)) == expected


def test_statistics_start_again_after_a_step():
    optimizer = surfels([SMALL] * 2)
    control = control_of(optimizer, [1.0, 0.0])
    control.step(10, optimizer, torch.Generator())
    assert control.gradients.tolist() == [0, 0, 0]
    assert control.counts.tolist() == [0, 0, 0]


def test_opacities_are_reset_to_a_hundredth_at_most():
    optimizer = surfels([SMALL] * 3, [0.9, 0.02, 0.006])
    step(optimizer, [0.0] * 3, iteration=25, resets=[5, 25])
    opacities = optimizer.parameters["opacities"].sigmoid()
    torch.testing.assert_close(opacities, torch.tensor([RESET_OPACITY, RESET_OPACITY, 0.006]))


def test_surfels_may_all_be_removed():
    optimizer = surfels([SMALL] * 2, [0.001, 0.001])
    assert step(optimizer, [1.0, 0.0]) == []
    assert step(optimizer, []) == []
