"""Clicks in space, and segments from clicks, on scenes whose parts and depths are known."""

import pytest
import torch

from tests.edit.lift_scenes import BLUE, RED, cameras, joined, nested, overlap, shell, truth, two_balls
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.errors import ShapeError
from texgs.core.light import HEADLIGHT
from texgs.edit.clicks import Clicks, inside_of, is_visible, places_of
from texgs.edit.lift import components_at, lift, middle_of, view_mask
from texgs.edit.new_segment import clicked_mask, preview
from texgs.models.masks import GrabCut

SIZE = 120
FRONT = orbit(-90, 0, 4.0, 22.0, SIZE, SIZE)  # on +z


class Alike:
    """A mask model that takes all pixels of the colour class of the first positive click."""

    name = "alike"

    def __init__(self):
        self.images, self.clicked = [], []

    def __call__(self, image, points, positive, held=None, shown=None):
        self.images.append(image)
        self.clicked.append((points, positive))
        if not len(points):
            return held
        x, y = points[positive][0].long().tolist()
        hue = image[..., 0] - image[..., 2]
        sign = torch.sign(hue[y, x])
        return hue * sign > 0.1


def pixel_of(place, camera=FRONT):
    return camera.project(torch.tensor([place]))[0][0]


def clicks(*places, negative=(), camera=FRONT):
    points = torch.stack([pixel_of(place, camera) for place in (*places, *negative)])
    return Clicks(camera, points, torch.arange(len(points)) < len(places))


def drawn(outline, *, negative=()):
    """What an outline in space selects, seen from the front."""
    points = torch.stack([pixel_of(place) for place in negative]) if negative else torch.zeros(0, 2)
    held = inside_of(torch.stack([pixel_of(place) for place in outline]), FRONT)
    return Clicks(FRONT, points, torch.zeros(len(points), dtype=torch.bool), held)


@pytest.fixture(scope="module")
def balls():
    """Two balls that do not touch, and which surfels are of the first."""
    model, number = two_balls()
    return model, number == 0


def agreement(segment, model, expected, views):
    """Overlap of a segment and the surfels expected, by their weights in the views."""
    return overlap(segment.mask, expected, sum(truth(model, expected, camera)[1] for camera in views))


def test_a_click_is_where_its_ray_meets_the_surface(balls):
    places = places_of(balls[0], clicks((-0.3, 0.05, 0.0), (0.3, 0.1, 0.1), negative=[(-0.25, -0.1, 0.0)]))
    middles = torch.tensor([[-0.3, 0.0, 0.0], [0.3, 0.1, 0.1], [-0.3, 0.0, 0.0]])
    torch.testing.assert_close((places - middles).norm(dim=1), torch.full((3,), 0.25), atol=0.02, rtol=0)
    assert (places[:, 2] > middles[:, 2]).all(), "on the side that faces the camera"


@pytest.mark.parametrize(("opacity", "distance"), [(0.08, 0.2), (0.9, 0.4)])
def test_a_click_through_a_thin_layer_is_on_what_shows_through(opacity, distance):
    place = places_of(nested(opacity)[0], clicks((0.0, 0.0, 0.0)))[0]
    assert float(place.norm()) == pytest.approx(distance, abs=0.03)
    assert place[2] > 0


@pytest.mark.parametrize(
    ("point", "message"),
    [
        ((2.0, 3.0), r"point \(2, 3\): expected a place on the model, got background \(alpha 0.00\)"),
        ((-1.0, 3.0), r"point \(-1, 3\): expected a place in the view"),
    ],
)
def test_clicks_that_are_on_nothing(balls, point, message):
    given = Clicks(FRONT, torch.tensor([point]), torch.tensor([True]))
    refused(lambda: lift(balls[0], given, cameras(), Alike()), message)


def test_clicks_that_do_not_fit():
    two, none = torch.ones(2, 2), torch.tensor([False, False])
    refused(lambda: Clicks(FRONT, two, none), "points: expected a positive one at least, got none")
    refused(lambda: Clicks(FRONT, two, none[:1]), r"positive: expected \[2\], got \[1\]", ShapeError)


def test_places_are_visible_where_nothing_is_in_front_of_them():
    model, _ = joined(
        shell(1500, 0.25, (0.0, 0.0, 0.5), RED, 0.95), shell(1500, 0.25, (0.0, 0.0, -0.5), BLUE, 0.95)
    )
    places = torch.tensor([[0.0, 0.0, 0.75], [0.0, 0.0, -0.25], [0.0, 0.0, -0.75]])
    expected = {-90: [True, False, False], 90: [False, False, True]}
    for azimuth, seen in expected.items():
        camera = orbit(azimuth, 0, 4.0, 22.0, SIZE, SIZE)
        median = model.render(camera, outputs=("median",)).median
        assert is_visible(*camera.project(places), median, 0.03).tolist() == seen
    above = orbit(-90, 50, 4.0, 22.0, SIZE, SIZE)
    median = model.render(above, outputs=("median",)).median
    assert is_visible(*above.project(places), median, 0.03).tolist() == [True, True, False]
    outside = torch.tensor([[50.0, 0.0, 0.0], [0.0, 0.0, 9.0]])
    assert not is_visible(*FRONT.project(outside), median, 0.03).any(), "beside and behind the camera"


@pytest.mark.parametrize(("vote", "least"), [("contribution", 0.97), ("centre", 0.8)])
def test_one_click_segments_an_object_on_all_of_its_sides(balls, vote, least):
    segment = lift(balls[0], clicks((-0.3, 0.0, 0.25)), cameras(), Alike(), vote=vote)
    assert agreement(segment, *balls, cameras()) > least
    assert segment.used > 30, "also views that see nothing of the place clicked on"
    assert segment.used + segment.left_out == 43


def test_the_mask_model_sees_what_the_view_shows_and_clicks_move_along(balls):
    """Images are cut out around the object: the colour under the click must be the one clicked on."""
    model, _ = balls
    masks = Alike()
    click = clicks((0.3, 0.1, 0.35))
    mask = view_mask(model, click, masks, HEADLIGHT)
    image, ((point,), _) = masks.images[0], masks.clicked[0]
    assert image.shape[0] * image.shape[1] < 0.7 * SIZE * SIZE
    x, y = point.long().tolist()
    full = model.render(FRONT).color
    column, row = click.points[0].long().tolist()
    torch.testing.assert_close(image[y, x], full[row, column].clamp(0, 1), atol=1e-4, rtol=0)
    expected = (full[..., 2] - full[..., 0]) > 0.1
    assert (mask != expected).sum() <= 2


def test_masks_end_where_the_model_shows_nothing(balls):
    """Whatever the mask model says: in a view of opaque balls, on a white background and on an outline."""
    model, _ = balls
    alpha = model.render(FRONT).alpha
    seen = []

    def everything(image, points, positive, held, shown):
        seen.append(shown)
        return torch.ones(image.shape[:2], dtype=torch.bool)

    mask = clicked_mask(model, clicks((-0.3, 0.0, 0.25)), everything)
    assert torch.equal(mask, alpha >= 0.05)
    assert int(seen[0].sum()) == int(mask.sum()), "the mask model is told what is shown"
    outline = drawn(rectangle(-0.7, 0.0))
    assert torch.equal(view_mask(model, outline, everything, HEADLIGHT), (alpha >= 0.05) & outline.held)


def test_a_mask_that_contradicts_the_others_has_no_vote(balls):
    class Confused(Alike):
        def __call__(self, image, points, positive, held=None, shown=None):
            right = super().__call__(image, points, positive, held, shown)
            return ~right if len(self.images) % 4 == 0 else right

    segment = lift(balls[0], clicks((-0.3, 0.0, 0.25)), cameras(), Confused())
    assert agreement(segment, *balls, cameras()) > 0.97
    assert segment.left_out >= 10


LEFT, RIGHT = -0.6, 0.62  # of both balls


def rectangle(left, right, bottom=-0.4, top=0.5):
    return [(left, bottom, 0.0), (right, bottom, 0.0), (right, top, 0.0), (left, top, 0.0)]


def test_a_box_selects_what_it_holds_on_all_sides(balls):
    model, is_red = balls
    some = cameras(size=128, frequency=1)
    red = lift(model, drawn(rectangle(LEFT, 0.0)), some, GrabCut())
    assert agreement(red, model, is_red, some) > 0.95
    other = lift(model, drawn(rectangle(LEFT, RIGHT), negative=[(-0.3, 0.0, 0.25)]), some, GrabCut())
    assert agreement(other, model, ~is_red, some) > 0.95


def test_an_outline_cuts_an_object_in_space(balls):
    """Of one colour, which no mask model parts."""
    model, is_red = balls
    some = cameras(size=128, frequency=1)
    half = lift(model, drawn(rectangle(LEFT, 0.0, bottom=0.0)), some, Alike())
    upper = is_red & (model.parameters["means"][:, 1] > 0)
    assert agreement(half, model, upper, some) > 0.9


def test_pixels_are_inside_of_an_outline_whose_rays_cross_it_an_odd_number_of_times():
    held = inside_of(torch.tensor([(10.0, 20.0), (30.0, 20.0), (30.0, 25.0), (10.0, 25.0)]), FRONT)
    assert held[20:25, 10:30].all()
    assert held.sum() == 5 * 20
    generator = torch.Generator().manual_seed(0)
    star = torch.rand(9, 2, generator=generator) * SIZE  # it crosses itself
    held = inside_of(star, FRONT)
    for row, column in torch.randint(SIZE, (300, 2), generator=generator).tolist():
        x, y, count = column + 0.5, row + 0.5, 0
        for (x0, y0), (x1, y1) in zip(star.tolist(), star.roll(-1, 0).tolist(), strict=True):
            count += (y0 <= y) != (y1 <= y) and x0 + (y - y0) / (y1 - y0) * (x1 - x0) < x
        assert bool(held[row, column]) == (count % 2 == 1)


@pytest.mark.parametrize(
    ("outline", "message"),
    [
        ([(1, 1), (9, 1), (121, 9)], r"outline: expected corners in 120 x 120 pixels, got \(121, 9\)"),
        ([(1, 1), (float("nan"), 1), (9, 9)], r"outline: expected corners .* got \(nan, 1\)"),
        ([(1, 1), (9, 9), (20, 20)], "outline: expected pixels inside of it, got none"),
    ],
)
def test_outlines_that_hold_nothing(outline, message):
    refused(lambda: inside_of(torch.tensor(outline, dtype=torch.float32), FRONT), message)


def test_nothing_selected_is_an_error(balls):
    def blind(image, points, positive, held, shown):
        return torch.zeros(image.shape[:2], dtype=torch.bool)

    below = drawn(rectangle(-0.7, 0.7, top=-0.35))
    refused(lambda: lift(balls[0], below, cameras(), GrabCut()), "outline: expected an object, got none")
    click = clicks((-0.3, 0.0, 0.25))
    refused(lambda: lift(balls[0], click, cameras(), blind), "surfels that most masks of 1 views hold")


def test_the_middle_of_a_mask_is_farthest_from_its_outline():
    mask = torch.zeros(20, 30, dtype=torch.bool)
    mask[3:12, 5:14] = True
    mask[7, 14:29] = True
    assert middle_of(mask) == (9.5, 7.5)
    assert middle_of(torch.zeros(3, 3, dtype=torch.bool)) is None


def test_a_preview_shows_the_mask_and_the_clicks(balls):
    model, _ = balls
    click = clicks((-0.3, 0.0, 0.25), negative=[(0.3, 0.1, 0.35)])
    mask, picture = (find(model, click, Alike()) for find in (clicked_mask, preview))
    full = model.render(FRONT).color.clamp(0, 1)
    (x0, y0), (x1, y1) = click.points.long().tolist()
    assert mask[y0, x0]
    assert not mask[y1, x1]
    assert picture[y0, x0].tolist() == pytest.approx([0.0, 0.7, 0.0])
    assert picture[y1, x1].tolist() == pytest.approx([0.0, 0.0, 0.9])
    far = mask.clone()
    far[y0 - 3 : y0 + 4, x0 - 3 : x0 + 4] = False
    torch.testing.assert_close(picture[far], 0.4 * full[far] + 0.6 * torch.tensor([1.0, 0.1, 0.1]))
    assert torch.equal(picture[0], full[0]), "the background stays"


def test_only_the_component_that_holds_the_place_is_kept(balls):
    model, is_red = balls
    means = model.parameters["means"]
    x, both, one = means[:, 0], torch.ones_like(is_red), torch.arange(len(is_red)) == 7
    middle, other = (means[which].mean(0, keepdim=True) for which in (is_red, ~is_red))
    assert torch.equal(components_at(model, both, middle), is_red)
    assert torch.equal(components_at(model, both, torch.cat([middle, other])), both)
    assert torch.equal(components_at(model, one, torch.zeros(1, 3)), one), "of a single surfel"
    two = one | (torch.arange(len(is_red)) == len(is_red) - 1)  # one of each ball
    assert torch.equal(components_at(model, two, means[one]), one)
    red = x[is_red]
    ends = is_red & ((x < red.quantile(0.2)) | (x > red.quantile(0.8)))  # what is between connects nothing
    at = means[is_red & (x == red.min())]
    assert torch.equal(components_at(model, ends, at), ends & (x < red.quantile(0.5)))
