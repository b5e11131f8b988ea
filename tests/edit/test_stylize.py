from dataclasses import replace

import pytest
import torch

from tests.edit.scenes import ball, plain_style, task, two_steps, views
from tests.models.networks import random_weights
from tests.refusals import refused
from texgs.core.errors import ArgumentError, FitError, ShapeError
from texgs.edit.methods.image import ImageKeys, run
from texgs.edit.readable import readable_factors
from texgs.edit.recipe import PRESETS, preset
from texgs.edit.style_picture import StylePicture
from texgs.edit.style_start import pixel_side, start_colors
from texgs.edit.stylize import Stylized, stylize
from texgs.fields.part_edit import PartEdit
from texgs.fields.splats import GEOMETRY
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.texels import owners, reduce_constant_textures
from texgs.models.pictures import picture
from texgs.models.vgg import Vgg
from texgs.raster.shading import MATERIAL
from texgs.scene.scene import Scene, SceneModel

CHANGED = {"texels", "colors"}


@pytest.fixture(scope="module")
def style():
    return StylePicture.of(picture("dots", 96))


def short(name="default", **changes):
    return preset(name, **{"iterations": 6, **changes})


def styled(style, recipe, model=None, **options):
    """What came of stylising a model, or the ball, in six views."""
    return stylize(model or ball(), *views(), style, recipe, **options)


def base_color(model):
    """c_ind of every texel: palette + offset + texel."""
    p = model.parameters
    places, surfel = owners(p)
    colors = p["texels"].clone()
    colors[places] += p["palette"] + p["colors"][surfel]
    return colors


@pytest.mark.parametrize("name", [name for name in PRESETS if name != "paper"])
def test_only_texels_and_offsets_change_and_base_colours_are_colours(name, vgg, style):
    model = ball()
    before = {key: x.clone() for key, x in model.parameters.items()}
    iterations = 0 if name == "preview" else 4
    done = styled(style, preset(name, iterations=iterations), model, vgg=vgg)
    assert all(torch.equal(before[key], x) for key, x in model.parameters.items()), "the model given"
    for key, x in done.model.parameters.items():
        assert torch.equal(x, before[key]) == (key not in CHANGED), key
    assert {*GEOMETRY, *MATERIAL, "sizes", "offsets", "palette"} <= before.keys()
    color = base_color(done.model)
    assert color.min() > -1e-6
    assert color.max() < 1 + 1e-6
    assert {len(values) for values in done.losses.values()} <= {iterations}


def test_a_plain_style_becomes_the_colour_of_the_surface():
    """Its projection is that colour, whatever light: c_ind * gain + highlight is what Blinn-Phong says."""
    color = torch.tensor([0.2, 0.6, 0.3])
    style = plain_style(color.tolist())
    model = ball()
    plain = {**model.parameters, "palette": color, "colors": torch.zeros_like(model.parameters["colors"])}
    done = styled(style, preset("preview"), model)
    for look in ("shaded", "unshaded"):
        image, expected = (
            Composition([x]).render(views()[0][0], look=look).color for x in (done.model, Surfels(plain))
        )
        torch.testing.assert_close(image, expected, atol=1e-5, rtol=0)


def test_iterations_lower_the_loss_on_views_not_trained_on(vgg, style):
    cameras, lights = views(8)
    recipe = short(iterations=40, start="random", patches=20.0)
    done = stylize(ball(), cameras[:6], lights[:6], style, recipe, vgg=vgg)
    for name in ("nnfm", "patches"):
        values = done.losses[name]
        assert sum(values[-6:]) < 0.9 * sum(values[:6]), name
    assert {"start", "render", "losses", "update"} < done.seconds.keys()


def test_without_weights_patches_alone_bring_the_colours_of_the_style(style):
    done = styled(style, short("patches", iterations=60, start="random", is_lit=False))
    after, before = (render_unlit(model, views()[0][1]) for model in (done.model, ball()))
    assert (after - style.mean).abs().max() < 0.06
    assert (before - style.mean).abs().max() > 0.2


def render_unlit(model, camera):
    """Mean colour of what is opaque."""
    shown = Composition([model]).render(camera, look="unshaded")
    return shown.color[shown.alpha > 0.9].mean(0)


def test_an_edit_is_the_same_with_the_same_seed_and_another_with_another(vgg, style):
    runs = [styled(style, short(seed=seed), vgg=vgg).model.parameters["texels"] for seed in (1, 1, 2)]
    assert torch.equal(runs[0], runs[1])
    assert not torch.equal(runs[0], runs[2])


@pytest.mark.parametrize("is_textured", [True, False])
def test_surfels_that_are_not_chosen_stay_as_they_are(vgg, style, is_textured):
    model = ball()
    chosen = model.parameters["means"][:, 0] > 0
    recipe = short(is_textured=is_textured)
    done = styled(style, recipe, model, vgg=vgg, surfels=chosen).model.parameters
    before = model.parameters
    places, surfel = owners(before)
    kept = places[~chosen[surfel]]
    assert torch.equal(done["texels"][kept], before["texels"][kept])
    assert torch.equal(done["colors"][~chosen], before["colors"][~chosen])
    name, mine = ("texels", places[chosen[surfel]]) if is_textured else ("colors", chosen)
    changed = (done[name] != before[name]).any(dim=1)
    assert changed[mine].float().mean() > 0.9


def test_the_palette_of_a_styled_model_can_still_be_changed(style):
    model, camera = styled(style, preset("preview")).model, views()[0][0]
    palette, moved = model.parameters["palette"], torch.tensor([0.1, 0.0, 0.2])
    scene = Composition([model])
    plain = scene.render(camera, look="unshaded")
    edit = PartEdit(palette=tuple((palette + moved).tolist()))
    edited = scene.render(camera, edits=[edit], look="unshaded")
    torch.testing.assert_close(edited.color, plain.color + plain.alpha[..., None] * moved, atol=1e-5, rtol=0)
    darker = PartEdit(palette=tuple((palette - 0.1).clamp_min(0).tolist()))
    lit, dark = (scene.render(camera, edits=[edit]).color.mean() for edit in (PartEdit(), darker))
    assert dark < lit - 0.01, "with light, too, and where colours become smaller"


def test_without_texture_each_surfel_has_one_colour_that_learns(style):
    start = styled(style, short("preview", is_textured=False, iterations=0)).model
    done = styled(style, short("patches", is_textured=False)).model
    for model in (start, done):
        assert model.parameters["texels"].abs().max() < 1e-6, "the colour is that of the surfel"
        assert len(reduce_constant_textures(model).parameters["texels"]) == len(model)
    assert (done.parameters["colors"] - start.parameters["colors"]).abs().max() > 0.01


def test_a_clip_term_is_any_loss_of_an_image(vgg, style):
    """A term that wants red: with lambda_s 0 nothing else speaks, and VGG is not needed."""
    seen = []

    def redness(image):
        seen.append(image.shape)
        return (image - torch.tensor([1.0, 0.0, 0.0])).square().mean()

    recipe = short(iterations=30, lambda_s=0.0, patches=0.0, start="mean", rate=0.1)
    done = styled(style, recipe, clip=redness)
    assert all(len(shape) == 3 and shape[2] == 3 for shape in seen)
    red, green, blue = render_unlit(done.model, views()[0][0])
    assert red > 0.7 > 0.3 > max(green, blue)
    both = styled(style, short(lambda_s=0.9), vgg=vgg, clip=redness)
    assert both.losses.keys() == {"nnfm", "distribution", "clip", "patches"}


def test_the_paper_looks_at_the_whole_view_over_white(vgg, style):
    seen = []

    def look(image):
        seen.append(image.detach())
        return image.mean()

    styled(style, preset("paper", iterations=2), vgg=vgg, clip=look)
    assert {tuple(image.shape) for image in seen} == {(64, 64, 3)}
    assert all(torch.equal(image[0, 0], torch.ones(3)) for image in seen)


@pytest.mark.parametrize("opacity", [4.0, -2.0])  # opaque, and so translucent that recipes adapt to it
@pytest.mark.parametrize("start", ["projected", "sphere"])
def test_an_edit_starts_from_its_preview_bit_for_bit(vgg, style, start, opacity):
    model, shown = ball(opacity=opacity), []

    def show(result):
        shown.append(result())

    recipe = preset("preview", start=start)
    preview = styled(style, recipe, model)
    assert (preview.recipe == recipe) is (opacity == 4.0), "or it is adapted"
    for name in ("default", "patches"):
        no_step = preset(name, start=start, rate=0.0, iterations=1)
        styled(style, no_step, model, vgg=vgg, show=show)
        assert all(torch.equal(x, shown[-1].parameters[key]) for key, x in preview.model.parameters.items())
    assert len(shown) == 2


def test_starts(style):
    names = ("projected", "sphere", "mean", "random", "transfer")
    recipes = {name: preset("preview", start=name, pattern=1.0) for name in names}
    colors = {name: base_color(styled(style, recipe).model) for name, recipe in recipes.items()}
    style = style.scaled(64)  # as it is laid onto views of that size
    pixels = style.pixels
    assert torch.allclose(colors["mean"], style.mean, atol=1e-5)
    assert all((pixels - color).abs().sum(1).min() < 1e-5 for color in colors["random"][:5])
    assert (colors["random"].mean(0) - pixels.mean(0)).abs().max() < 0.02
    assert (colors["transfer"].mean(0) - style.mean).abs().max() < 0.1
    assert min(colors[name].std(dim=0).min() for name in ("projected", "sphere")) > 0.05


def test_colours_of_a_segment_are_moved_to_those_of_the_style(style):
    model = ball()
    _, surfel = owners(model.parameters)
    mine = torch.zeros(len(surfel), dtype=torch.bool)
    mine[owners(model.parameters)[0]] = surfel % 2 == 0
    moved = start_colors("transfer", model, style, 0.01, 0, mine)
    whole = start_colors("transfer", model, style, 0.01, 0)
    goal = style.pixels.mean(0)
    assert (moved[mine].mean(0) - goal).norm() < 0.05
    assert not torch.equal(moved, whole)


def test_a_pixel_is_as_large_as_the_camera_shows_it():
    """At distance 1.5 a field of view of 50 degrees is 2 * 1.5 * tan(25 degrees) high."""
    cameras, _ = views(size=64)
    assert pixel_side(ball(), cameras) == pytest.approx(2 * 1.5 * 0.4663 / 64, rel=1e-3)


def test_views_that_do_not_show_the_model_change_nothing(vgg, style):
    cameras, lights = views()
    away = [replace(camera, viewmat=torch.diag(torch.tensor([-1.0, 1, -1, 1])) @ camera.viewmat)
            for camera in cameras]  # fmt: skip
    start = styled(style, preset("preview")).model
    done = stylize(ball(), away, lights, style, short(), vgg=vgg)
    assert torch.equal(done.model.parameters["texels"], start.parameters["texels"])
    assert ball().render(away[0]).alpha.max() == 0


def test_mistakes_are_named_before_any_work(vgg, style):
    cameras, lights = views()
    texture = {"texels", "sizes", "offsets", "palette"}
    shading = {name: x for name, x in ball().parameters.items() if name not in texture}
    cases = [
        ({"model": Surfels(shading)}, ArgumentError, "model: expected stage texture, got shading"),
        ({"lights": lights[:2]}, ArgumentError, "expected one for each of some cameras, got 2 for 6"),
        ({"cameras": [], "lights": []}, ArgumentError, "got 0 for 0"),
        ({"vgg": None}, ArgumentError, "vgg: expected a VGG for this recipe, got none"),
        ({"recipe": short(lambda_s=0.5)}, ArgumentError, "clip: expected a CLIP term for lambda_s = 0.5"),
        ({"surfels": torch.ones(3, dtype=torch.bool)}, ShapeError, r"surfels: expected \[400\]"),
        ({"surfels": torch.zeros(400, dtype=torch.bool)}, ArgumentError, "surfels: expected at least one"),
    ]
    given = {"model": ball(), "cameras": cameras, "lights": lights, "style": style, "recipe": short()}
    for changes, error, message in cases:
        refused(lambda changes=changes: stylize(**{**given, "vgg": vgg, **changes}), message, error)


def test_a_loss_that_is_not_finite_stops_the_edit(style):
    recipe = short(lambda_s=0.0, patches=0.0)
    infinite = lambda image: image.mean() / 0  # noqa: E731
    refused(lambda: styled(style, recipe, clip=infinite), "the loss is not finite in iteration 1", FitError)


@pytest.mark.parametrize(("recipe", "dtype"), [("paper", torch.float32), ("default", None)])
def test_the_paper_keeps_opacities_and_computes_features_in_single_precision(
    tmp_path, monkeypatch, recipe, dtype
):
    """The others raise opacities of faint parts, and take what VGG-16 is fastest with on a machine."""
    torch.save(random_weights(last=14), tmp_path / "vgg.pth")
    loaded, seen = Vgg.load(tmp_path / "vgg.pth"), []
    monkeypatch.setattr(Vgg, "load", lambda device, dtype: seen.append(dtype) or loaded)

    def stylize(model, cameras, lights, picture, given, **options):
        seen.append(given.opacity)
        return Stylized(model, given, {}, {})

    monkeypatch.setattr("texgs.edit.stylize.stylize", stylize)
    scene = Scene({"ball": SceneModel(write_model(tmp_path / "ball", ball(opacity=-2.2)))})
    given = replace(task(scene, tmp_path), settings=ImageKeys(recipe=recipe, lambda_s=1.0))
    shown = run(given).scene.models["ball"].edit.opacity
    factor = 1.0 if recipe == "paper" else readable_factors(scene, ["ball"], "cpu")["ball"]
    assert seen == [dtype, factor]
    assert shown == factor


def test_half_precision_learns_what_single_precision_does(tmp_path, style):
    """Texels after a few steps: a gradient that underflowed would leave them where they were."""
    torch.save(random_weights(last=14), tmp_path / "vgg.pth")
    recipe = short(iterations=2, patches=0.0)
    start = styled(style, preset("preview")).model.parameters["texels"]
    moves = []
    for kind in (torch.float32, torch.float16):
        vgg = Vgg.load(tmp_path / "vgg.pth", dtype=kind)
        moves.append(styled(style, recipe, vgg=vgg).model.parameters["texels"] - start)
    # Adam turns noise of gradients near 0 into whole steps: not all of them agree.
    assert torch.cosine_similarity(moves[0].flatten(), moves[1].flatten(), dim=0) > 0.8


def test_what_only_another_step_shows_learns_from_it(style):
    key, step, upper = two_steps()
    start, done, alone = (
        styled(style, recipe, key, steps=steps).model.parameters["texels"]
        for recipe, steps in ((preset("preview"), [step]), (short("patches"), [step]), (short("patches"), []))
    )
    unmoved = styled(style, preset("preview"), key).model.parameters["texels"]
    places, surfel = owners(key.parameters)
    hidden = upper[surfel]
    assert torch.equal(alone[places][hidden], unmoved[places][hidden]), "no view shows them"
    assert (done != start)[places][hidden].float().mean() > 0.3
    assert (start != unmoved)[places][hidden].float().mean() > 0.3, "the picture lies where they show"
