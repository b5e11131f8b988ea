from dataclasses import replace
from pathlib import Path

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.edit.guidances import Tint
from tests.edit.scenes import ball, task, views
from tests.fitting.scenes import HEADLIGHT
from tests.refusals import refused
from texgs.core.oklab import chromaticity, oklab
from texgs.edit.hue import ALIKE, ALONE, HueBound
from texgs.edit.methods.image import ImageKeys, run
from texgs.edit.methods.text import METHOD, TextKeys
from texgs.edit.new_look import settings_of
from texgs.edit.recipe import preset
from texgs.edit.style_picture import StylePicture
from texgs.edit.stylize import learned_style, stylize
from texgs.edit.task import Task
from texgs.edit.text import RECIPES, edit_by_text
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.texels import bare_colors, owners
from texgs.models.pictures import picture
from texgs.scene.scene import Scene, SceneModel
from texgs.volume.view_set import View

GREEN, CREAM = (0.3, 0.6, 0.35), (0.9, 0.8, 0.65)
SHADE = 0.02  # how much eight bits and the edge of what a screen shows may move a hue


def colored(rgb, model=None):
    """A ball of one colour."""
    model = model or ball()
    p = model.parameters
    plain = {"texels": torch.zeros_like(p["texels"]), "colors": torch.zeros_like(p["colors"])}
    return replace(model, parameters={**p, **plain, "palette": torch.tensor(rgb)})


def bound(share, rgb=GREEN, surfels=None):
    return HueBound.of({"a": colored(rgb), "b": colored(CREAM)}, "a", surfels, share)


def away(colors, rgb):
    """How far colours are from the hue of another one."""
    return (chromaticity(colors) - chromaticity(torch.tensor(rgb))).norm(dim=-1)


unit = st.floats(0, 1)


@settings(max_examples=50, deadline=None)
@given(st.tuples(*[st.floats(0.2, 0.8)] * 3), unit, st.integers(0, 2**31))
def test_colours_are_within_reach_and_as_light_in_order(rgb, share, seed):
    hue = bound(share, rgb)
    colors = torch.rand(2000, 3, generator=torch.Generator().manual_seed(seed))
    toned = hue.toned(colors)
    assert toned.min() >= 0
    assert toned.max() <= 1
    assert float(away(toned, rgb).max()) <= hue.reach + SHADE
    before, after = oklab(colors)[:, 0], oklab(toned)[:, 0]
    is_shown = (toned.amax(1) < 0.999) & (toned.amin(1) > 0.001)  # others are as a screen can show their hue
    assert float(after[is_shown][before[is_shown].argsort()].diff().min()) > -2e-3


def test_tones_differ_however_dark_this_hue_is_and_black_has_a_hue():
    greys = torch.linspace(0, 1, 500)[:, None].expand(-1, 3)
    tones = oklab(bound(0.0, (0.1, 0.1, 0.8)).toned(greys))[:, 0]
    assert float(tones[:480].diff().min()) > 1e-5
    assert tones[0] > 0.05


def test_the_reach_is_a_share_of_the_way_to_the_most_similar_function():
    far = float(away(torch.tensor(CREAM), GREEN))
    assert bound(0.3).reach == pytest.approx(0.3 * far, rel=1e-4)
    others = {"a": colored(GREEN), "b": colored((0.9, 0.2, 0.2)), "c": colored(CREAM)}
    assert HueBound.of(others, "a", None, 0.3).reach == pytest.approx(0.3 * far, rel=1e-4)
    assert HueBound.of({"a": colored(GREEN)}, "a", None, 0.5).reach == pytest.approx(0.5 * ALONE)
    twins = {"a": colored(GREEN), "b": colored(GREEN)}
    assert HueBound.of(twins, "a", None, 0.5).reach == pytest.approx(0.5 * ALIKE)


def test_the_loss_is_what_is_beyond_the_reach_and_its_gradient_is_right():
    hue = bound(0.5)
    hue = replace(hue, middle=hue.middle.double())
    inside = hue.toned(torch.rand(3, 4, 3)).permute(2, 0, 1).double()
    assert float(hue.loss(inside)["hue"]) < 1e-3
    image = torch.rand(3, 4, 5, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    assert float(hue.loss(image)["hue"]) > 0.1
    image = (0.2 + 0.6 * image).requires_grad_()
    torch.autograd.gradcheck(lambda x: hue.loss(x)["hue"], image)
    kept = replace(hue, reach=0.0)
    same = torch.tensor(GREEN)[:, None, None].expand(3, 2, 2).clone().requires_grad_()
    (gradient,) = torch.autograd.grad(kept.loss(same)["hue"], same)
    assert bool(gradient.isfinite().all())


def test_each_surfel_keeps_its_own_hue():
    """A function may change its hue with the value."""
    model = colored(GREEN)
    p = model.parameters
    half = torch.arange(len(model)) % 2 == 0
    colors = torch.where(half[:, None], torch.tensor([0.1, 0.0, 0.0]), torch.tensor([0.0, 0.0, 0.15]))
    model = replace(model, parameters={**p, "colors": colors})
    hue = HueBound.of({"a": model}, "a", None, 0.0)
    assert float((hue.hues[half][0] - hue.hues[~half][0]).norm()) > 0.05
    place, surfel = owners(p)
    greys = torch.linspace(0.2, 0.6, len(place))[:, None].expand(-1, 3)
    found = chromaticity(hue.at_texels(greys, model)[place])
    assert float((found - hue.hues[surfel]).norm(dim=1).max()) < 1e-3
    of_half = HueBound.of({"a": model}, "a", half, 0.0)
    torch.testing.assert_close(of_half.middle, hue.hues[half][0])
    made = edit_by_text(model, views()[0], Tint((0.5, 0.5, 0.5)), "x", RECIPES["quick"], hue=hue, size=96)
    found = chromaticity(bare_colors(made.model).clamp(0, 1)[place])
    assert float((found - hue.hues[surfel]).norm(dim=1).quantile(0.99)) < SHADE, "also by words"


@pytest.mark.parametrize("recipe", ["preview", "patches"])
def test_a_look_by_a_picture_keeps_the_hue_that_it_lies_on(recipe):
    model, style = colored(GREEN), StylePicture.of(picture("glass", 96))
    recipe = preset(recipe, **({"iterations": 8} if recipe == "patches" else {}))
    free = stylize(model, *views(), style, recipe).model
    kept = learned_style(style, 64, recipe, bound(0.1)).image.permute(1, 2, 0)
    assert float(away(kept, GREEN).max()) < bound(0.1).reach + SHADE
    for share in (0.0, 0.3):
        hue = HueBound.of({"a": model, "b": colored(CREAM)}, "a", None, share)
        done = stylize(model, *views(), style, recipe, hue=hue)
        assert ("hue" in done.losses) == (recipe.iterations > 0), "a loss keeps it, too"
        kept = done.model
        colors = bare_colors(kept).clamp(0, 1)
        assert float(away(colors, GREEN).quantile(0.99)) < hue.reach + SHADE
        lightness = oklab(colors)[:, 0]
        assert float(lightness.std()) > 0.3 * float(oklab(bare_colors(free).clamp(0, 1))[:, 0].std())
    assert float(away(bare_colors(free).clamp(0, 1), GREEN).quantile(0.9)) > 0.2


def test_other_surfels_stay_bit_for_bit():
    model = ball()
    some = model.parameters["means"][:, 0] > 0
    hue = HueBound.of({"a": model}, "a", some, 0.2)
    done = stylize(
        model, *views(), StylePicture.of(picture("glass", 96)), preset("preview"), surfels=some, hue=hue
    ).model
    place, surfel = owners(model.parameters)
    rest = place[~some[surfel]]
    assert torch.equal(done.parameters["texels"][rest], model.parameters["texels"][rest])
    assert torch.equal(done.parameters["colors"][~some], model.parameters["colors"][~some])


def test_a_look_by_words_keeps_the_hue_that_it_lies_on():
    model = colored(GREEN)
    hue = HueBound.of({"a": model, "b": colored(CREAM)}, "a", None, 0.1)
    cameras, _ = views()
    red = edit_by_text(model, cameras, Tint((0.9, 0.1, 0.1)), "x", RECIPES["quick"], size=96)
    kept = edit_by_text(model, cameras, Tint((0.9, 0.1, 0.1)), "x", RECIPES["quick"], hue=hue, size=96)
    assert float(away(bare_colors(red.model).clamp(0, 1), GREEN).median()) > 0.2
    seen = kept.images[kept.views.alphas > 0.99]
    assert float(away(seen, GREEN).quantile(0.99)) < hue.reach + SHADE, "texels learn from it"
    assert float(away(bare_colors(kept.model).clamp(0, 1), GREEN).quantile(0.99)) < hue.reach + SHADE


class SeenFromAround(Task):
    """A task whose models have views without images."""

    def training_views(self, model):
        return [View(camera, Path(), HEADLIGHT) for camera in views()[0]]


def test_a_look_on_a_look_keeps_the_hue_of_the_function(tmp_path):
    """What a model shows by then is of the earlier look."""
    models = {"a": colored(GREEN), "b": colored(CREAM)}
    scene = Scene({key: SceneModel(write_model(tmp_path / key, each)) for key, each in models.items()})
    for share, name in ((1.0, "one"), (0.0, "two")):
        keys = ImageKeys(style="glass", recipe="preview", hue=share, opacity="keep")
        given = vars(task(scene, tmp_path / name)) | {"settings": keys}
        (tmp_path / name).mkdir()
        scene = run(SeenFromAround(**given)).scene
    for name, rgb in (("a", GREEN), ("b", CREAM)):
        colors = bare_colors(scene.models[name].surfels()[0]).clamp(0, 1)
        assert float(away(colors, rgb).quantile(0.99)) < SHADE


def test_gold_by_words_has_the_hue_of_the_function_and_white_highlights(tmp_path):
    scene = Scene({"a": SceneModel(write_model(tmp_path / "a", colored(GREEN)))})
    for share in (0.0, 1.0):
        keys = TextKeys(instruction="make it gold", guidance="filters", size=64, opacity="keep", hue=share)
        given = vars(task(scene, tmp_path / str(share))) | {"settings": keys, "draws": False}
        (tmp_path / str(share)).mkdir()
        entry = METHOD.run(SeenFromAround(**given)).scene.models["a"]
        assert (entry.edit.tint == PartEdit.tint) == (share == 0)
        assert entry.edit.specular != 1, "a part of the material that has no hue"
        far = float(away(bare_colors(entry.surfels()[0]).clamp(0, 1), GREEN).quantile(0.99))
        assert (far < SHADE) == (share == 0)


def test_hues_of_a_model_without_texture_are_refused_and_those_of_others_do_not_count():
    model = ball()
    p = {k: x for k, x in model.parameters.items() if k not in ("palette", "texels", "sizes", "offsets")}
    bare = replace(model, parameters=p)
    refused(lambda: HueBound.of({"a": bare}, "a", None, 0.5), "stage texture.*shading.*texture first")
    assert HueBound.of({"a": colored(GREEN), "b": bare}, "a", None, 0.5).reach == pytest.approx(0.5 * ALONE)


def test_a_hue_beyond_all_hues_is_refused():
    refused(lambda: settings_of("image", {"hue": 1.5}), "hue.* 1.*1.5")
