import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.testing import assert_close

from tests.devices import device  # noqa: F401, a fixture
from tests.fitting.scenes import cameras, images_of, random_surfels
from tests.raster.requirements import with_threads
from texgs.core.camera import orbit
from texgs.fields.splats import REACH, screen_box
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel
from texgs.volume.images import MARGIN, PixelBox, content_box


def box_of(seen):
    """The smallest box of a mask [H, W]."""
    rows, columns = seen.any(dim=1).nonzero(), seen.any(dim=0).nonzero()
    return PixelBox(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)


def is_inside(box, other):
    return box.union(other) == other


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(4, 12),
    spread=st.floats(0, 0.6),
    size=st.floats(1e-3, 0.5),
    distance=st.floats(0.5, 4),
    low_pass=st.floats(0.5, 20),
)
def test_nothing_is_drawn_outside_the_box_of_the_surfels(seed, count, spread, size, distance, low_pass):
    p = random_surfels(seed, count, spread, size)
    camera = orbit(seed % 360, 20, distance, 50, 48, 40)
    shading = ShadingModel(low_pass)
    alpha = Surfels(p, shading).render(camera).alpha
    if (alpha > 0).any():
        assert is_inside(box_of(alpha > 0), screen_box(p, shading.options, camera))


def bounds(p, camera):
    """Least depth, left, right, top and bottom of spheres around all surfels, by plain torch."""
    points = p["means"].double() @ camera.viewmat[:3, :3].T.double() + camera.viewmat[:3, 3].double()
    reach = REACH * p["scales"].double().amax(dim=1).exp()
    depths = points[:, 2] + torch.stack([-reach, reach])  # [2, N]
    edges = []
    for at in (points[:, 0], points[:, 1]):
        edges += [float(((at - reach) / depths).min()), float(((at + reach) / depths).max())]
    return float(depths.min()), *edges


@pytest.mark.parametrize("count", [4, 15, 9001])
@pytest.mark.parametrize("axes", [2, 3])
def test_the_box_is_that_of_all_spheres(count, axes, device):  # noqa: F811
    p = random_surfels(count, count, 0.3, 0.1)
    p["scales"] = torch.cat([p["scales"], p["scales"][:, :1] + 0.3], dim=1)[:, :axes]
    camera = orbit(30, 20, 4, 50, 300, 200)
    _, left, right, top, bottom = bounds(p, camera)
    (fx, _, cx), (_, fy, cy), _ = camera.K.tolist()
    disc = REACH * (0.3 if axes == 3 else 1 / 2) ** 0.5
    edges = (fx * left + cx - disc, fy * top + cy - disc, fx * right + cx + disc, fy * bottom + cy + disc)
    options = ShadingModel(low_pass=2.0).options
    box = with_threads(2, lambda: [screen_box({k: x.to(device) for k, x in p.items()}, options, camera)])[0]
    for side, edge in zip(box, edges, strict=True):
        assert abs(side - edge) <= 1.01
    assert is_inside(PixelBox(*map(round, edges)), box)


@pytest.mark.parametrize("name", ["means", "scales"])
@pytest.mark.parametrize("value", [torch.nan, torch.inf])
def test_a_value_that_is_not_finite_needs_the_whole_image(name, value, device):  # noqa: F811
    p = random_surfels(0, 40, 0.1, 0.1)
    p[name][17, 1] = value
    camera = cameras(1)[0]
    assert screen_box(p, ShadingModel().options, camera) == PixelBox(0, 0, camera.width, camera.height)


@pytest.mark.parametrize("mean", [(0.0, 0.0, 1.0), (0.0, 0.0, torch.nan)])
def test_a_surfel_around_the_camera_or_nowhere_needs_the_whole_image(mean):
    p = random_surfels(0, 4, 0.0, 0.1)
    camera = cameras(1)[0]
    p["means"][0] = camera.position if mean[2] == 1 else torch.tensor(mean)
    assert screen_box(p, ShadingModel().options, camera) == PixelBox(0, 0, camera.width, camera.height)
    none = {name: x[:0] for name, x in p.items()}
    assert screen_box(none, ShadingModel().options, camera) == PixelBox(16, 16, 16, 16), "one place"


def test_content_is_what_is_not_white():
    planes = torch.full((4, 20, 30), 255, dtype=torch.uint8)
    planes[3] = 0
    empty = content_box(planes.numpy())
    assert (empty.left, empty.top) == (empty.right, empty.bottom)
    planes[1, 5, 7] = 254
    planes[3, 11, 22] = 1
    assert content_box(planes.numpy()) == PixelBox(7, 5, 23, 12)


def test_a_box_gets_a_margin_but_stays_in_the_image_with_a_pixel_at_least():
    assert PixelBox(30, 40, 45, 50).within(100, 100) == PixelBox(
        30 - MARGIN, 40 - MARGIN, 45 + MARGIN, 50 + MARGIN
    )
    assert PixelBox(2, -50, 99, 300).within(100, 80) == PixelBox(0, 0, 100, 80)
    for box in (PixelBox(-90, -90, -80, -80), PixelBox(500, 500, 600, 600)):
        left, top, right, bottom = box.within(100, 80)
        assert 0 <= left < right <= 100
        assert 0 <= top < bottom <= 80


def test_the_camera_of_a_part_sees_that_part():
    p, camera = random_surfels(5, 40, 0.2, 0.1), orbit(30, 20, 1.5, 50, 48, 40)
    whole = Surfels(p).render(camera).color
    part = Surfels(p).render(camera.crop(7, 3, 40, 31)).color
    assert_close(part, whole[3:31, 7:40], atol=2e-5, rtol=0)


def test_the_part_keeps_the_light_and_moves_the_principal_point():
    camera = cameras(1, size=64)[0]
    images = images_of([torch.zeros(4, 64, 64)], [camera])
    target = images.target(0, around=PixelBox(0, 0, 1, 1))
    assert target.share == 1
    assert torch.equal(target.camera.K, camera.K)
