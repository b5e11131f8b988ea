"""Clicks in space, and segments from clicks, on scenes whose parts and depths are known."""

import pytest
import torch

from tests.edit.lift_scenes import BLUE, RED, cameras, joined, nested, overlap, shell, truth, two_balls
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError, ShapeError
from texgs.core.light import HEADLIGHT
from texgs.edit.clicks import Clicks, is_visible, places_of
from texgs.edit.lift import Lifted, components_at, lift, middle_of, view_mask
from texgs.edit.new_segment import preview
from texgs.models.grabcut import GrabCut

SIZE = 120
FRONT = orbit(-90, 0, 4.0, 22.0, SIZE, SIZE)  # on +z


class Alike:
    """A mask model that takes all pixels of the colour class of the first positive click."""

    name = "alike"

    def __init__(self):
        self.images, self.clicked = [], []

    def __call__(self, image, points, positive):
        self.images.append(image)
        self.clicked.append((points, positive))
        x, y = points[positive][0].long().tolist()
        hue = image[..., 0] - image[..., 2]
        sign = torch.sign(hue[y, x])
        return hue * sign > 0.1


def pixel_of(place, camera=FRONT):
    return camera.project(torch.tensor([place]))[0][0]


def clicks(*places, negative=(), camera=FRONT):
    points = torch.stack([pixel_of(place, camera) for place in (*places, *negative)])
    return Clicks(camera, points, torch.arange(len(points)) < len(places))


def test_a_click_is_where_its_ray_meets_the_surface():
    model, _ = two_balls()
    places = places_of(model, clicks((-0.3, 0.05, 0.0), (0.3, 0.1, 0.1), negative=[(-0.25, -0.1, 0.0)]))
    middles = torch.tensor([[-0.3, 0.0, 0.0], [0.3, 0.1, 0.1], [-0.3, 0.0, 0.0]])
    torch.testing.assert_close((places - middles).norm(dim=1), torch.full((3,), 0.25), atol=0.02, rtol=0)
    assert (places[:, 2] > middles[:, 2]).all(), "on the side that faces the camera"


def test_a_click_through_a_thin_layer_is_on_what_shows_through():
    for opacity, distance in ((0.08, 0.2), (0.9, 0.4)):
        model, _ = nested(opacity)
        place = places_of(model, clicks((0.0, 0.0, 0.0)))[0]
        assert float(place.norm()) == pytest.approx(distance, abs=0.03)
        assert place[2] > 0


@pytest.mark.parametrize(
    ("point", "message"),
    [
        ((2.0, 3.0), r"point \(2, 3\): expected a place on the model, got background \(alpha 0.00\)"),
        ((120.0, 3.0), r"point \(120, 3\): expected a place in the view of 120 x 120 pixels"),
        ((-1.0, 3.0), r"point \(-1, 3\): expected a place in the view"),
    ],
)
def test_clicks_that_are_on_nothing(point, message):
    model, _ = two_balls()
    with pytest.raises(ArgumentError, match=message):
        lift(model, Clicks(FRONT, torch.tensor([point]), torch.tensor([True])), cameras(), Alike())


def test_clicks_that_do_not_fit():
    with pytest.raises(ArgumentError, match="points: expected a positive one at least, got none"):
        Clicks(FRONT, torch.ones(2, 2), torch.zeros(2, dtype=torch.bool))
    with pytest.raises(ShapeError, match=r"positive: expected \[2\], got \[1\]"):
        Clicks(FRONT, torch.ones(2, 2), torch.ones(1, dtype=torch.bool))


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


@pytest.mark.parametrize("vote", ["contribution", "centre"])
def test_one_click_segments_an_object_on_all_of_its_sides(vote):
    model, numbers = two_balls()
    segment = lift(model, clicks((-0.3, 0.0, 0.25)), cameras(), Alike(), vote=vote)
    weights = sum(truth(model, numbers == 0, camera)[1] for camera in cameras())
    assert overlap(segment.mask, numbers == 0, weights) > (0.97 if vote == "contribution" else 0.8)
    assert segment.used > 30, "also views that see nothing of the place clicked on"
    assert segment.used + segment.left_out == 43


def test_grabcut_segments_an_object():
    model, numbers = two_balls()
    some = cameras(size=128, frequency=1)
    segment = lift(model, clicks((0.3, 0.1, 0.35), negative=[(-0.3, 0.0, 0.25)]), some, GrabCut())
    weights = sum(truth(model, numbers == 1, camera)[1] for camera in some)
    assert overlap(segment.mask, numbers == 1, weights) > 0.95


def test_the_mask_model_sees_what_the_view_shows_and_clicks_move_along():
    """Images are cut out around the object: the colour under the click must be the one clicked on."""
    model, _ = two_balls()
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


def test_a_mask_that_contradicts_the_others_has_no_vote():
    model, numbers = two_balls()

    class Confused(Alike):
        def __call__(self, image, points, positive):
            right = super().__call__(image, points, positive)
            return ~right if len(self.images) % 4 == 0 else right

    segment = lift(model, clicks((-0.3, 0.0, 0.25)), cameras(), Confused())
    weights = sum(truth(model, numbers == 0, camera)[1] for camera in cameras())
    assert overlap(segment.mask, numbers == 0, weights) > 0.97
    assert segment.left_out >= 10


def test_a_segment_without_surfels_is_an_error():
    model, _ = two_balls()

    class Blind(Alike):
        def __call__(self, image, points, positive):
            return torch.zeros(image.shape[:2], dtype=torch.bool)

    with pytest.raises(ArgumentError, match="expected surfels that most masks of 1 views hold, got none"):
        lift(model, clicks((-0.3, 0.0, 0.25)), cameras(), Blind())


def test_the_middle_of_a_mask_is_farthest_from_its_outline():
    mask = torch.zeros(20, 30, dtype=torch.bool)
    mask[3:12, 5:14] = True
    mask[7, 14:29] = True
    assert middle_of(mask) == (9.5, 7.5)
    assert middle_of(torch.zeros(3, 3, dtype=torch.bool)) is None


def test_a_preview_shows_the_mask_and_the_clicks():
    model, _ = two_balls()
    click = clicks((-0.3, 0.0, 0.25), negative=[(0.3, 0.1, 0.35)])
    mask, picture = preview(model, click, Alike())
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


def test_a_segment_of_almost_the_whole_model_is_told():
    part, whole = (Lifted(torch.arange(20) < count, torch.ones(1, 1) > 0, 40, 2) for count in (17, 19))
    assert part.basis == "masks of 40 of 42 views"
    assert whole.basis.startswith(
        "masks of 40 of 42 views hold 95% of the model; if that is too much, click "
    )


def balls():
    """Two balls that do not touch, and which surfels are of the first."""
    model, number = two_balls()
    return model, number == 0


def test_only_the_component_that_holds_the_place_is_kept():
    model, is_red = balls()
    both = torch.ones_like(is_red)
    middle = model.parameters["means"][is_red].mean(0, keepdim=True)
    assert torch.equal(components_at(model, both, middle), is_red)
    other = model.parameters["means"][~is_red].mean(0, keepdim=True)
    assert torch.equal(components_at(model, both, torch.cat([middle, other])), both)


def test_what_is_not_in_the_segment_connects_nothing():
    model, is_red = balls()
    x = model.parameters["means"][:, 0]
    red = x[is_red]
    ends = is_red & ((x < red.quantile(0.2)) | (x > red.quantile(0.8)))
    at = model.parameters["means"][is_red & (x == red.min())]
    assert torch.equal(components_at(model, ends, at), ends & (x < red.quantile(0.5)))


def test_a_single_surfel_is_a_component():
    model, is_red = balls()
    one = torch.zeros_like(is_red)
    one[7] = True
    assert torch.equal(components_at(model, one, torch.zeros(1, 3)), one)
