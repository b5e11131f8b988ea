from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from tests.raster.requirements import require_equal
from tests.real_data import real_data
from tests.refusals import refused
from texgs.core.geometry import quats_to_matrices
from texgs.core.lens import Lens
from texgs.fitting.casting import cast_views
from texgs.fitting.hull import hull_points, mean_colors
from texgs.fitting.seeds import box_of, read_points, seed_surfels, surfels_at
from texgs.fitting.settings import Seeds
from texgs.volume.cameras import icosphere
from texgs.volume.caster import Caster
from texgs.volume.grid import Grid
from texgs.volume.images import load
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction
from texgs.volume.view_set import ViewSet, read_views

from .scenes import HEADLIGHT, RADIUS, ball_images, blank_images, cameras, images_of, is_finite

BOX = (torch.full((3,), -0.55), torch.full((3,), 0.55))


def random_numbers(seed=0):
    return torch.Generator().manual_seed(seed)


def view_set(folder=Path("views"), **metadata):
    return ViewSet(folder, [], [], metadata)


def seeds(folder=Path("views"), images=None, metadata=None, seed=0, volume=None, count=300, **options):
    views = view_set(folder, **metadata or {})
    return seed_surfels(images or ball_images(), views, Seeds(count=count, **options), seed, volume)


def write_ply(path, columns):
    """An ASCII PLY file of vertices; columns are name to (type, values)."""
    n = len(next(iter(columns.values()))[1])
    header = ["ply", "format ascii 1.0", f"element vertex {n}"]
    header += [f"property {kind} {name}" for name, (kind, _) in columns.items()] + ["end_header"]
    rows = zip(*(values for _, values in columns.values()), strict=True)
    path.write_text("\n".join(header + [" ".join(map(str, row)) for row in rows]) + "\n")


def xyz(n=5):
    return {name: ("float", [axis + 0.25 * row for row in range(n)]) for axis, name in enumerate("xyz")}


def colored(kind, values):
    return {**xyz(), **dict.fromkeys(("red", "green", "blue"), (kind, values))}


def test_hull_points_are_seen_by_every_view():
    images = ball_images()
    points = hull_points(images, BOX, 500, random_numbers())
    assert points.shape == (500, 3)
    for index, camera in enumerate(images.cameras):
        in_camera = points.double() @ camera.viewmat[:3, :3].double().T + camera.viewmat[:3, 3].double()
        places = in_camera @ camera.K.double().T
        columns, rows = (places[:, :2] / places[:, 2:]).floor().long().T
        assert (images.planes[index, 3][rows, columns] > 0).all()


def test_the_hull_of_a_ball_is_little_more_than_the_ball():
    images = ball_images(count=24, size=64)
    distances = hull_points(images, BOX, 2000, random_numbers()).norm(dim=1)
    pixel = 1.5 / float(images.cameras[0].K[0, 0])
    assert (distances < RADIUS + 6 * pixel).all()
    # All of the ball is filled evenly: half of its volume lies within 2^(-1/3) of its radius.
    inside = distances[distances < RADIUS]
    assert (inside < RADIUS * 0.5 ** (1 / 3)).float().mean() == pytest.approx(0.5, abs=0.05)


def test_points_outside_of_a_view_are_not_carved_by_it():
    camera = cameras(1)[0]
    empty = images_of([torch.zeros(4, camera.height, camera.width)], [camera])
    behind = (camera.position * 1.5 - 0.01, camera.position * 1.5 + 0.01)
    assert len(hull_points(empty, behind, 10, random_numbers())) == 10


def test_views_that_show_nothing_have_no_hull_but_random_seeds():
    empty = blank_images()
    refused(lambda: hull_points(empty, BOX, 100, random_numbers()), "visual hull")
    refused(lambda: seeds(images=empty), "visual hull")
    parameters, colors = seeds(images=empty, kind="random")
    assert torch.equal(colors, torch.full((300, 3), 0.5))
    assert is_finite(parameters)


def test_colours_are_means_without_the_background():
    views = cameras(4)
    tint = torch.tensor([0.2, 0.6, 1.0])
    planes = []
    for alpha in (1.0, 0.5, 0.5, 0.0):
        over_white = tint * alpha + 1 - alpha
        planes.append(torch.cat([over_white, torch.tensor([alpha])])[:, None, None].expand(4, 32, 32))
    points = torch.cat([torch.zeros(1, 3), torch.full((1, 3), 50.0)])
    colors = mean_colors(images_of(planes, views), points)
    torch.testing.assert_close(colors[0], tint, atol=0.01, rtol=0)  # 8 bits
    assert torch.equal(colors[1], torch.zeros(3))


def test_scales_are_distances_of_the_three_nearest():
    points = torch.rand(60, 3, generator=random_numbers())
    distances = np.sort(cdist(points.double(), points.double()), axis=1)[:, 1:4]
    surfels = surfels_at(points, 0.3, random_numbers())
    expected = torch.from_numpy(np.sqrt((distances**2).mean(axis=1))).float()
    torch.testing.assert_close(surfels["scales"].exp(), expected[:, None].repeat(1, 2))
    torch.testing.assert_close(surfels["opacities"].sigmoid(), torch.full((60,), 0.3))
    torch.testing.assert_close(surfels["quats"].norm(dim=1), torch.ones(60))
    assert torch.equal(surfels["means"], points)


def test_points_may_be_equal_but_not_too_few():
    assert torch.isfinite(surfels_at(torch.zeros(10, 3), 0.1, random_numbers())["scales"]).all()
    refused(lambda: surfels_at(torch.zeros(3, 3), 0.1, random_numbers()), "at least 4 points, got 3")


@pytest.mark.parametrize("kind", ["visible", "hull", "random"])
def test_the_same_seed_gives_the_same_surfels_and_another_one_others(kind):
    (first, colors), (same, same_colors), (other, _) = (seeds(kind=kind, seed=s) for s in (3, 3, 4))
    assert {name: len(x) for name, x in first.items()} == dict.fromkeys(first, 300)
    assert colors.shape == (300, 3)
    assert 0 <= colors.min() <= colors.max() <= 1
    assert torch.equal(colors, same_colors)
    require_equal(same, first)
    assert not torch.equal(first["means"], other["means"])


def test_visible_surfels_are_on_the_opaque_ball_not_in_it():
    options = {"images": ball_images(count=12, size=64), "count": 500}
    filled, _ = seeds(kind="hull", **options)
    seen, _ = seeds(kind="visible", **options)
    depth = [torch.quantile(x["means"].norm(dim=1), 0.25) / RADIUS for x in (filled, seen)]
    assert depth[0] == pytest.approx(0.25 ** (1 / 3), abs=0.06)
    assert depth[1] > 0.78


def test_given_points_are_taken_as_they_are(tmp_path):
    write_ply(tmp_path / "points3d.ply", colored("uchar", [0, 51, 102, 153, 255]))
    parameters, seed_colors = seeds(tmp_path, kind="points", count=2)
    expected = torch.tensor([[0.0, 1.0, 2.0]]) + 0.25 * torch.arange(5)[:, None]
    assert torch.equal(parameters["means"], expected)
    torch.testing.assert_close(seed_colors, torch.tensor([0.0, 0.2, 0.4, 0.6, 1.0])[:, None].repeat(1, 3))


def test_points_without_colours_take_those_of_the_views(tmp_path):
    write_ply(tmp_path / "points3d.ply", {name: ("double", [0.0, 0.1, 0.0, 0.1, 0.05]) for name in "xyz"})
    images = ball_images()
    parameters, colors = seeds(tmp_path, images, kind="points")
    assert torch.equal(colors, mean_colors(images, parameters["means"]))
    write_ply(tmp_path / "a.ply", colored("float", [0.5] * 5))
    assert torch.equal(read_points(tmp_path / "a.ply")[1], torch.full((5, 3), 0.5)), "they may be floats"


@pytest.mark.parametrize(
    ("columns", "end", "named"),
    [
        (colored("ushort", [0, 256, 0, 0, 65535]), None, "0 to 255, .* 65535"),
        (colored("short", [-1, 0, 0, 0, 9]), None, "0 to 255, .* -1 to 9"),
        (colored("float", [0.0, 0.5, 255.0, 0.0, 0.0]), None, "0 to 1, .* 255"),
        ({name: column for name, column in xyz().items() if name != "z"}, None, "a number z each, got x, y"),
        ({**xyz(), "x": ("float", ["nan"] * 5)}, None, "finite x, y and z"),
        (xyz(3), None, "at least 4 points, got 3"),
        (xyz(), -12, "a whole PLY file"),
        (xyz(), 2, "a whole PLY file"),
    ],
)
def test_mistakes_in_points_are_named(tmp_path, columns, end, named):
    path = tmp_path / "points3d.ply"
    refused(lambda: seeds(tmp_path, kind="points"), f"{path}: no such file")
    write_ply(path, columns)
    path.write_bytes(path.read_bytes()[:end])
    refused(lambda: seeds(tmp_path, kind="points"), named)


@pytest.mark.parametrize(
    ("metadata", "half_size", "low", "high"),
    [
        ({"aabb": [[-0.5, -0.25, 0.0], [0.5, 0.25, 0.1]]}, None, (-0.52, -0.27, -0.02), (0.52, 0.27, 0.12)),
        # The release has random points within 1.3 of the middle of data from -0.5 to 0.5.
        ({"aabb": [[-0.5, -0.25, 0.0], [0.5, 0.25, 0.1]]}, 2.6, (-1.3, -1.3, -1.25), (1.3, 1.3, 1.35)),
        ({}, 2.6, (-1.3,) * 3, (1.3,) * 3),
        ({}, None, (-0.55,) * 3, (0.55,) * 3),
    ],
)
def test_the_box_is_that_of_the_data_with_a_margin_or_a_cube(metadata, half_size, low, high):
    box = torch.stack(box_of(view_set(**metadata), half_size))
    torch.testing.assert_close(box, torch.tensor([low, high]))


NO_BOXES = ([1, 2], "box", [[0, 0, 0], [1, 1, "x"]], [[0, 0], [1, 1]], {}, [[1, 0, 0], [0, 1, 1]])


@pytest.mark.parametrize("aabb", [*NO_BOXES, [[0, 0, float("nan")], [1, 1, 1]]])
def test_an_aabb_that_is_no_box_is_an_error(aabb):
    refused(lambda: box_of(view_set(aabb=aabb), 1.0), "aabb: ")


NO_VOLUME, NO_FUNCTION = {"metadata": {"tf": {}}}, {"volume": Grid(np.zeros((2, 2, 2), np.float32))}


@pytest.mark.parametrize(
    ("named", "options"),
    [
        *((r"seeds\.opacity", {"opacity": opacity}) for opacity in (0.0, 1.0, -1.0)),
        *((r"seeds\.kind=volume", {"kind": "volume", **options}) for options in (NO_VOLUME, NO_FUNCTION)),
    ],
)
def test_what_seeds_need_is_named(named, options):
    refused(lambda: seeds(**options), named)


def test_points_published_with_the_paper_are_near_what_its_views_show():
    views = read_views(real_data("vortex/TF01"))
    images = load(views.train[:3], 8)
    parameters, colors = seed_surfels(images, views, Seeds("points"), 0)
    assert len(parameters["means"]) == len(colors) > 9000
    assert (mean_colors(images, parameters["means"]) - colors).abs().mean() < 0.15


def parts(size=96):
    """A large ball, a thin rod and a speck apart from it as masks [Z, Y, X], and a function that shows them.

    The rod is 2 samples thick, the speck 3.
    """
    at = np.linspace(-0.5, 0.5, size)
    z, y, x = np.meshgrid(at, at, at, indexing="ij")
    masks = {
        "ball": np.hypot(np.hypot(x, y), z + 0.15) < 0.25,
        "rod": (np.hypot(y + 0.3, z) < 0.011) & (np.abs(x) < 0.45),
        "speck": np.hypot(np.hypot(x - 0.3, y - 0.3), z - 0.3) < 0.016,
    }
    tf = {"name": "TF01", "opacity": [[0.5, 0.0], [1.0, 1.0], [2.0, 1.0]], "color": [[0, 0.8, 0.4, 0.2]]}
    return masks, tf


def seen(grid, tf, cameras):
    """Images of a volume."""
    function = TransferFunction.from_dict({name: tf[name] for name in ("opacity", "color")})
    return cast_views(Caster(grid, Appearance()), function, [(each, HEADLIGHT) for each in cameras], "views")


def near(masks, places):
    """How many of places [N, 3] are within three samples of each part."""
    found = {}
    for name, mask in masks.items():
        own = np.argwhere(mask)[:, ::-1] / (mask.shape[0] - 1) - 0.5
        found[name] = int((cKDTree(own).query(places)[0] < 3 / mask.shape[0]).sum())
    return found


def grid_of(*masks):
    return Grid(np.any(masks, axis=0).astype(np.float32))


def test_each_part_of_a_volume_has_its_share_of_seeds_however_thin_or_small():
    """That is its share of what views show, here of each part alone."""
    masks, tf = parts()
    grid, around = grid_of(*masks.values()), icosphere(2, Lens(2.4, 30, 96, 96))
    alone = {name: float(seen(grid_of(mask), tf, around).planes[:, 3].sum()) for name, mask in masks.items()}
    images, count = seen(grid, tf, around), 4000
    surfels, _ = seeds(images=images, metadata={"tf": tf}, volume=grid, count=count)
    found = near(masks, surfels["means"])
    assert sum(found.values()) > 0.99 * count, "nowhere else"
    for name, shown in alone.items():
        expected = count * shown / sum(alone.values())
        assert found[name] == pytest.approx(expected, rel=0.1, abs=3 * expected**0.5), name
    hull, _ = seeds(images=images, count=count, kind="visible")
    assert near(masks, hull["means"])["rod"] < 0.1 * found["rod"], "what the hull is not enough for"


def test_seeds_in_a_volume_lie_on_what_shows_and_face_out():
    masks, tf = parts(48)
    grid = grid_of(masks["ball"])
    options = {"images": seen(grid, tf, cameras(12)), "metadata": {"tf": tf}, "volume": grid}
    surfels, colors = seeds(**options)
    out = surfels["means"] - torch.tensor([0, 0, -0.15])
    assert (out.norm(dim=1) - 0.25).abs().max() < 2 / 48
    facing = (quats_to_matrices(surfels["quats"])[..., 2] * out).sum(dim=1) / out.norm(dim=1)
    assert facing.median() > 0.95
    torch.testing.assert_close(colors, torch.tensor([0.8, 0.4, 0.2]).expand(300, 3), atol=0.02, rtol=0)


def test_there_are_as_many_in_a_volume_as_are_kept_and_fewer_are_told(capsys):
    masks, tf = parts(48)
    grid = grid_of(masks["ball"])
    images = seen(grid, tf, cameras(12))
    views = view_set(tf=tf)
    surfels, _ = seed_surfels(images, views, Seeds(), 0, grid, 500)
    assert len(surfels["means"]) == 500
    assert "seeds" not in capsys.readouterr().err
    surfels, _ = seed_surfels(images, views, Seeds(count=9000), 0, grid, 500)
    assert f"views: found {len(surfels['means']):,} of 9,000 seeds, so that thin" in capsys.readouterr().err
