"""Fields that learn from views that are edited again and again: balls of Gaussians and of voxels."""

from dataclasses import replace

import pytest
import torch

from tests.edit.guidances import Returns, Tint
from tests.edit.scenes import images_of
from tests.edit.test_gaussians import ball as gaussians
from tests.fields.voxels.test_voxels import ball as voxels
from tests.fitting.scenes import cameras
from tests.refusals import refused
from texgs.core.errors import FitError, ShapeError
from texgs.edit.dataset_update import PhotometricLoss, azimuth, field_views, update_field, update_steps
from texgs.edit.gaussians import radii
from texgs.edit.methods.updates import DgeKeys, Igs2gsKeys, In2nKeys
from texgs.edit.recipe import UpdateSchedule
from texgs.edit.voxels import corner
from texgs.fields.optimizer import Rate
from texgs.fitting.settings import CommonRates
from texgs.raster.losses import ssim
from texgs.volume.images import PixelBox

COLOR = (0.8, 0.3, 0.1)
RATES = CommonRates(means=1e-4, sh=0.05, sh_rest=0.0025, means_final=1.0, final=1.0)
PIXELS = PhotometricLoss(0.8, 0.2)
PATCHES = PhotometricLoss(1.0, 0.0)


def splats(**keys):
    model = gaussians(degree=1)
    images = images_of(model, count=5)
    keys = DgeKeys(rates=RATES, **{"prune": False, **keys})
    return keys.learner(model, images, PIXELS, 100), images


def grid(frozen=False):
    field = voxels(degree=1)
    keys = In2nKeys(frozen=frozen, sh=0.05, patches=4, side=16)
    images = images_of(field, count=5)
    return keys.learner(field, images, PATCHES, 100), images


LEARNERS = {"gaussians": splats, "voxels": grid}


def color_of(field):
    """Mean colour where the field is opaque, from a place that is none of the training views'."""
    shown = field.render(cameras(7, 48)[3])
    return shown.color[shown.alpha > 0.9].mean(0)


@pytest.mark.parametrize(
    ("kind", "schedule"),
    [
        ("voxels", UpdateSchedule(10, 8, views=1)),
        ("gaussians", UpdateSchedule(2, 40, learned="newest")),
        ("gaussians", UpdateSchedule(2, 40, views=3, group=3, order="random", learned="round")),
    ],
    ids=["in2n", "igs2gs", "dge"],
)
def test_fields_take_on_the_colour_that_views_are_given(kind, schedule):
    learner, images = LEARNERS[kind]()
    before = images.planes.clone()
    start = color_of(learner.original)
    updated = update_field(learner, images, Tint(COLOR, lit=True), "anything", schedule)
    goal = torch.tensor(COLOR)
    assert (color_of(learner.field) - goal).norm() < 0.5 * (start - goal).norm()
    assert torch.equal(images.planes, before), "the training views stay as they are"
    assert torch.equal(color_of(learner.original), start), "so does the field before"
    assert len(updated.losses) == schedule.iterations
    assert updated.count == schedule.rounds * (schedule.views or len(images))
    assert len(updated.some(2)) == 2
    before, after = updated.some(2)[0]
    assert torch.equal(before, images.target(0).color)
    assert (after.mean((0, 1)) - before.mean((0, 1))).norm() > 0.01


@pytest.mark.parametrize("kind", LEARNERS)
@pytest.mark.parametrize("frozen", [True, False])
def test_frozen_geometry_is_kept_bit_for_bit(kind, frozen):
    learner, images = LEARNERS[kind](frozen=frozen)
    before = learner.original
    update_field(learner, images, Tint(COLOR), "anything", UpdateSchedule(3, 5, views=2))
    field = learner.field
    kept = [torch.equal(x, field.tensors("geometry")[name]) for name, x in before.tensors("geometry").items()]
    assert all(kept) == frozen
    assert not torch.equal(before.tensors("appearance")["sh"], field.tensors("appearance")["sh"])


@pytest.mark.parametrize("keeps", [True, False])
def test_edits_stay_close_to_training_views_or_to_the_field_as_it_was(keeps):
    learner, images = splats()
    images.planes[:, :3] = round(0.2 * 255)
    guidance = Tint(COLOR)
    schedule = UpdateSchedule(3, 4, views=5, group=5)
    update_field(learner, images, guidance, "anything", schedule, keeps_renders=keeps)
    first, *_, last = guidance.seen
    assert torch.equal(first.conditions, last.conditions), "of all edits, whatever the field is by then"
    assert not torch.equal(first.images, last.images)
    expected = first.images if keeps else torch.full_like(first.conditions, 0.2)
    torch.testing.assert_close(first.conditions, expected, atol=1e-6, rtol=0)


def test_the_guidance_is_told_how_much_noise_to_use_and_gets_views_around_the_object():
    learner, images = splats()
    guidance = Tint(COLOR)
    schedule = UpdateSchedule(2, 2, group=5, levels=((0.9, 0.9), (0.3, 0.3)))
    update_field(learner, images, guidance, "anything", schedule)
    assert [views.level for views in guidance.seen] == [0.9, 0.3]
    for views in guidance.seen:
        angles = [azimuth(camera) for camera in views.cameras]
        assert angles == sorted(angles)
        assert len(angles) == 5


def test_views_of_a_field_say_where_its_pixels_are():
    field = voxels().to("cpu")
    views = field_views(field, cameras(3, 64), torch.zeros(3, 64, 64, 3))
    inside = views.alphas > 0.95
    away = views.points[inside]
    facing = torch.nn.functional.cosine_similarity(views.normals[inside], away, dim=1)
    assert float(facing.median()) > 0.9, "normals of a ball point away from its middle"
    assert float(away.norm(dim=1).std()) < 0.1
    assert (views.normals[views.alphas == 0] == 0).all()
    wrong = torch.zeros(3, 5, 5, 3)
    refused(lambda: field_views(field, cameras(3, 64), wrong), "conditions: expected", ShapeError)


def test_the_first_step_of_gaussians_goes_against_the_gradient_of_the_loss_written_out():
    learner, images = splats()
    model = learner.original
    leaves = {name: x.clone().requires_grad_() for name, x in model.parameters.items()}
    images = replace(images, planes=images.planes[:1] // 2, cameras=images.cameras[:1])
    image = replace(model, parameters=leaves).render(images.cameras[0]).color
    wanted = images.target(0).color
    (0.8 * (image - wanted).abs().mean() + 0.2 * (1 - ssim(image, wanted))).backward()
    learner.step(images, [0], torch.Generator())
    after = learner.field.parameters
    for name, rate in (("opacities", RATES.opacities), ("means", RATES.means * learner.extent)):
        step, gradient = after[name] - model.parameters[name], leaves[name].grad
        clear = gradient.abs() > 1e-7
        torch.testing.assert_close(step[clear], -rate * gradient.sign()[clear], rtol=2e-3, atol=1e-6)


def test_gaussians_that_are_faint_or_large_are_removed():
    learner, images = splats()
    model = learner.original
    parameters = {name: x.clone() for name, x in model.parameters.items()}
    parameters["opacities"][:10] = -9.0
    parameters["scales"][10:30, 0] = 0.5
    spoilt = replace(model, parameters=parameters)
    learner = DgeKeys(rates=RATES).learner(spoilt, images, PIXELS, 200)
    learner.optimizer._rates = {name: Rate(0.0, 1.0) for name in learner.optimizer._rates}
    for _ in range(100):
        learner.step(images, [0], torch.Generator())
    assert len(learner.field) == len(model) - 30
    assert len(splats(prune=True, frozen=True)[0].field) == len(model)


def test_radii_are_those_of_a_sphere_on_the_axis():
    (camera,) = cameras(1, 48)
    ahead = camera.position + 2 * camera.viewmat[2, :3]
    behind = camera.position - camera.viewmat[2, :3]
    result = radii(torch.stack([ahead, behind]), torch.tensor([[0.1, 0.2, 0.05]] * 2).log(), camera)
    torch.testing.assert_close(result, torch.tensor([3 * 0.2 * float(camera.K[1, 1]) / 2, 0.0]))


def test_patches_lie_inside_of_the_image_and_around_what_is_visible():
    generator = torch.Generator().manual_seed(0)
    corners = torch.tensor([corner(PixelBox(30, 2, 40, 8), 16, (48, 64), generator) for _ in range(400)])
    assert (corners >= 0).all()
    assert (corners[:, 0] <= 48 - 16).all()
    assert int(corners[:, 0].min()) == 30 - 8
    assert int(corners[:, 0].max()) == 39 - 8
    assert int(corners[:, 1].max()) == 0


def test_a_loss_and_its_gradient_are_those_of_its_terms():
    generator = torch.Generator().manual_seed(1)
    image, wanted = torch.rand(2, 3, 20, 24, generator=generator).permute(0, 2, 3, 1)
    loss, gradient = PhotometricLoss(3.0, 1.0).with_gradient(image, wanted)
    leaf = image.clone().requires_grad_()
    expected = 3 * (leaf - wanted).abs().mean() + 1 - ssim(leaf, wanted)
    (exact,) = torch.autograd.grad(expected, leaf)
    assert loss == pytest.approx(float(expected.detach()), rel=1e-5)
    torch.testing.assert_close(gradient, exact, atol=1e-7, rtol=1e-3)


def test_what_a_guidance_returns_is_checked_and_a_loss_has_to_be_finite():
    def nothing(views):
        return views.images * float("nan")

    learner, images = splats()

    def update(guidance, words="anything"):
        return lambda: update_field(learner, images, guidance, words, UpdateSchedule(1, 5))

    refused(update(Returns(nothing)), "images edited by broken")
    refused(update(Tint(COLOR), " "), "instruction: expected what to do in words")
    learner.step = lambda *_: float("nan")
    refused(update(Tint(COLOR)), "iteration 0: expected a finite loss, got nan", FitError)


def made(schedule, count, seed=0):
    return list(update_steps(schedule, count, torch.Generator().manual_seed(seed)))


def test_in2n_edits_the_next_view_every_ten_iterations_and_learns_from_all():
    steps = made(In2nKeys(passes=2).schedule(7), 7)
    assert len(steps) == 2 * 7 * 10
    for iteration, step in enumerate(steps):
        assert step.edited == ([iteration // 10 % 7] if iteration % 10 == 0 else [])
        assert list(step.learned) == list(range(7))
    levels = [step.level for step in steps if step.edited]
    assert 0.02 <= min(levels) < max(levels) <= 0.98


def test_igs2gs_edits_all_views_in_turn_and_learns_from_each_at_once():
    steps = made(Igs2gsKeys(every=2500).schedule(162), 162)
    assert len(steps) == 7500
    assert sum(len(step.edited) for step in steps) == 3 * 162
    for iteration, step in enumerate(steps):
        place = iteration % 2500
        assert step.edited == ([place] if place < 162 else [])
        assert list(step.learned) == ([place] if place < 162 else list(range(162)))
    levels = [step.level for step in steps if step.edited]
    assert 0.7 <= min(levels) < max(levels) <= 0.98


def test_dge_edits_twenty_views_together_with_falling_noise_and_learns_from_nothing_else():
    steps = made(DgeKeys(rounds=5).schedule(92), 92)
    assert len(steps) == 2500
    rounds = [step for step in steps if step.edited]
    assert [step.level for step in rounds] == [0.998, 0.3, 0.3, 0.021, 0.021]
    for index, step in enumerate(rounds):
        assert len(set(step.edited)) == 20
        assert list(step.edited) == sorted(step.edited)
        for each in steps[500 * index : 500 * (index + 1)]:
            assert list(each.learned) == list(step.edited)
    assert list(rounds[0].edited) != list(rounds[1].edited)


def test_few_views_are_all_of_a_round():
    (first, *_) = made(UpdateSchedule(1, 3, views=20, group=20, order="random", learned="round"), 4)
    assert list(first.edited) == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("run", "message"),
    [
        (lambda: made(UpdateSchedule(3, 100), 162), "rounds of at least 162 iterations, .* got 100"),
        (lambda: In2nKeys(noise=[0.9, 0.1]).schedule(3), "edit.in2n.noise: expected two shares from 0 to 1"),
        (lambda: Igs2gsKeys(noise=[0.9]).schedule(3), "edit.igs2gs.noise: expected two shares from 0 to 1"),
        (lambda: DgeKeys(noise=[2.0]).schedule(3), "edit.dge.noise: expected one share from 0 to 1 at least"),
    ],
)
def test_schedules_that_cannot_be_name_the_key(run, message):
    refused(run, message)
