"""What edits learn from other steps of a series: where surfels show, and which views tell."""

from dataclasses import replace

import torch
from torch.testing import assert_close

from tests.edit.guidances import Returns, Tint
from tests.edit.scenes import ball, task, two_steps, views
from texgs.edit.steps import model_at_step, shots_of, weights_of, where_shown
from texgs.edit.text import RECIPES, edit_by_text
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.step_file import write_step
from texgs.fields.surfels.texels import bare_colors, owners
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.series_file import Series, read_series, write_series

RED, BLUE = torch.tensor([[0.9, 0.1, 0.1], [0.2, 0.3, 0.8]])


def test_a_picture_is_laid_onto_surfels_where_they_show_most_of_all_steps():
    key, step, upper = two_steps()
    laid = where_shown(key, [step], views()[0])
    weights = torch.stack([weights_of(each, views()[0]) for each in (key, step)])
    moved = (laid.parameters["means"] == step.parameters["means"]).all(dim=1)
    seen = weights.max(dim=0).values > 0
    assert torch.equal(moved[seen], (weights[1] > 4 * weights[0])[seen])
    assert moved[upper & seen].all()
    assert moved[~upper & seen].float().mean() < 0.2
    assert torch.equal(laid.parameters["opacities"], key.parameters["opacities"])


def test_a_look_of_a_series_is_learned_from_its_steps(tmp_path):
    key, step, _ = two_steps()
    file = write_model(tmp_path / "ball.safetensors", key)
    series = write_series(Series(tmp_path / "series.json", ["a", "b"], ["ball"]))
    for number, each in enumerate((key, step)):
        write_step(read_series(series).model("ball", number), key, each, {})
    scene = replace(Scene({"ball": SceneModel(file)}), series=read_series(series)).at(0)
    (other,) = task(scene, tmp_path).other_steps("ball")
    torch.testing.assert_close(other.parameters["means"], step.parameters["means"], atol=1e-4, rtol=0)
    assert task(Scene({"ball": SceneModel(file)}), tmp_path).other_steps("ball") == []


def red_then_blue(views):
    """The six views of the scene's step in red, and those of others in blue."""
    alpha, color = views.alphas[..., None], torch.stack([RED] * 6 + [BLUE] * (len(views) - 6))
    return color[:, None, None] * alpha + 1 - alpha


def distances(model, color):
    """How far each surfel's texels are from a colour, in their mean [N]."""
    places, surfel = owners(model.parameters)
    off = (bare_colors(model)[places] - color).abs().mean(dim=1)
    return torch.zeros(len(model)).scatter_reduce(0, surfel, off, "mean", include_self=False)


def edited(model, steps, recipe=RECIPES["default"], **options):
    """The model after an edit of six views in red, and of views of other steps in blue."""
    guidance = Returns(red_then_blue)
    guidance.lit = False
    return edit_by_text(model, views()[0], guidance, "x", recipe, size=96, steps=steps, **options).model


def test_surfels_that_only_another_step_shows_get_its_edited_colour():
    key, step, upper = two_steps()
    alone, done = (edited(key, steps) for steps in ([], [step]))
    assert distances(alone, RED).max() < 0.05
    assert (distances(done, BLUE)[upper] < 0.1).float().mean() > 0.8
    assert (distances(done, RED)[~upper] < 0.1).float().mean() > 0.9
    for name in ("means", "quats", "scales", "opacities"):
        assert torch.equal(done.parameters[name], key.parameters[name])


def test_only_chosen_surfels_learn_from_another_step():
    key, step, upper = two_steps()
    left = key.parameters["means"][:, 0] < 0
    done = edited(key, [step], surfels=left)
    assert torch.equal(done.parameters["colors"][~left], key.parameters["colors"][~left])
    assert (distances(done, BLUE)[upper & left] < 0.1).float().mean() > 0.7


def test_the_papers_recipe_sees_other_steps_too():
    key, step, upper = two_steps()
    recipe = replace(RECIPES["paper"], views="axes", iterations=150, rate=0.05)
    alone, done = (distances(edited(key, steps, recipe), BLUE)[upper] for steps in ([], [step]))
    assert torch.equal(alone, distances(key, BLUE)[upper]), "no view shows them, and they stay"
    assert done.mean() < 0.8 * alone.mean()


def test_views_of_other_steps_are_half_as_many_and_all_frame_both():
    key, step, _ = two_steps()
    far = replace(step, parameters={**step.parameters, "means": step.parameters["means"] + 0.5})
    guidance = Tint([0.2, 0.3, 0.8])
    edit_by_text(key, views()[0], guidance, "x", size=96, steps=[far])
    (seen,) = guidance.seen
    assert len(seen) == 9
    for alpha in seen.alphas:
        rim = torch.cat([alpha[0], alpha[-1], alpha[:, 0], alpha[:, -1]])
        assert alpha.max() > 0.9 > 0.5 > rim.max()


def test_views_of_steps_that_show_nothing_else_are_not_edited():
    key = ball()
    guidance = Tint([0.2, 0.3, 0.8])
    edit_by_text(key, views()[0], guidance, "x", size=96, steps=[key, key])
    assert len(guidance.seen[0]) == 6


def test_the_most_telling_views_come_first():
    """Each shows its surfels better, by pixels and opacity, than views of the model and views before."""
    key, step, upper = two_steps()
    everything, cameras = torch.ones_like(upper), views(12)[0]
    own, *others = shots_of(key, [step], cameras, everything)
    assert own.model is key
    assert own.surfels.all()
    known = torch.stack([weights_of(key, [camera]) for camera in cameras[::2]]).amax(0)
    for number, shot in enumerate(others):
        shows = weights_of(model_at_step(key, step), shot.cameras)
        assert torch.equal(shot.surfels, shows > 4 * known)
        if number == 0:
            every = [weights_of(model_at_step(key, step), [camera]) for camera in cameras[::2]]
            assert_close((shows - 4 * known).relu().sum(), max((w - 4 * known).relu().sum() for w in every))
        known = known.maximum(shows)
