"""What is left of the data in a look, in pictures whose answer is known, and in scenes of balls."""

from dataclasses import replace

import pytest
import torch

from tests.edit.scenes import ball
from tests.fields.test_sizes import gaussians
from tests.metrics.test_edit_metrics import subject
from tests.real_data import real_data
from tests.scene.test_twin import HIGH, LOOK, LOW, sphere_volume
from texgs.core.cuts import Cuts, Plane
from texgs.fields.gaussians import write_gaussians
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.metrics.edits.readability import METRIC
from texgs.metrics.metric import values_of
from texgs.metrics.readability import (
    keeps_order,
    legend_colors,
    mean_told,
    shares_of,
    told_by_hue,
    under_light_alone,
)
from texgs.raster import Render
from texgs.scene.scene import Scene, SceneModel, SceneSegment, SceneVolume
from texgs.scene.scene_file import write_scene
from texgs.scene.twin import Twin
from texgs.volume.nrrd_file import open_grid
from texgs.volume.prepare import prepare
from texgs.volume.sources import open_source

SIDE = 96
ORANGE, BLUE = (0.9, 0.5, 0.2), (0.3, 0.45, 0.8)
LEGEND = [torch.tensor([ORANGE]), torch.tensor([BLUE, (0.5, 0.7, 0.9)])]


def disc(middle, radius):
    """Where a disc is in a picture, which has sides of 2, [SIDE, SIDE] bool."""
    y, x = torch.meshgrid(*[torch.linspace(-1, 1, SIDE)] * 2, indexing="ij")
    return (x - middle).square() + y.square() < radius**2


DISCS = torch.stack([disc(-0.5, 0.4), disc(0.5, 0.3)], dim=-1).float()


def over_white(colors, alpha):
    """A picture of colours [H, W, 3] or [3] with alpha [H, W]."""
    return Render(alpha[..., None] * colors + (1 - alpha[..., None]), alpha)


def two_discs(first, second, opacity=1.0):
    """A picture of two discs, and the share of each in each pixel."""
    shares = opacity * DISCS
    return over_white(DISCS @ torch.tensor([first, second]), shares.sum(-1)), shares


@pytest.mark.parametrize("opacity", [1.0, 0.6])
def test_discs_in_their_own_colours_are_told_and_in_each_others_are_not(opacity):
    shown, told = told_by_hue(*two_discs(ORANGE, BLUE, opacity), LEGEND)
    assert len(shown) == DISCS.sum(), "the background does not count"
    assert torch.equal(shown, told)
    exchanged = told_by_hue(*two_discs(BLUE, ORANGE, opacity), LEGEND)
    assert torch.equal(*(1 - exchanged[0], exchanged[1]))
    shown, one = told_by_hue(*two_discs(ORANGE, ORANGE, opacity), LEGEND)
    assert (one == shown).sum() == DISCS[..., 0].sum()
    assert mean_told([torch.stack([shown, one])]) == 0.5, "functions count alike, however large they are"


@pytest.mark.parametrize("light", [0.8, 0.5, 0.2])
def test_darker_discs_are_told(light):
    """Also where light scales the values of a screen, as shading does, and not linear ones."""
    darker = ([light * x for x in color] for color in (ORANGE, BLUE))
    assert torch.equal(*told_by_hue(*two_discs(*darker), LEGEND))


def test_what_is_hardly_there_is_not_counted():
    assert not len(told_by_hue(*two_discs(BLUE, ORANGE, 0.4), LEGEND)[0])


def test_a_pixel_of_two_functions_counts_where_one_has_two_thirds():
    seen, _ = two_discs(ORANGE, BLUE)
    for share, count in ((0.6, 0), (0.7, DISCS.sum())):
        mixed = share * DISCS + (1 - share) * DISCS.flip(-1)
        assert len(told_by_hue(seen, mixed, LEGEND)[0]) == count


def shaded(power=1.0):
    """A grey ball under a light from above on the left, and where it is."""
    y, x = torch.meshgrid(*[torch.linspace(-1, 1, SIDE)] * 2, indexing="ij")
    z = (0.64 - x**2 - y**2).clamp_min(0).sqrt()
    cosine = ((-0.4 * x - 0.5 * y + 0.77 * z) / 0.8).clamp(0, 1)
    return (0.15 + 0.7 * cosine) ** power, disc(0, 0.8).float()


def order(grey, alpha, reference):
    return float(keeps_order(over_white(grey[..., None].expand(-1, -1, 3), alpha), reference).float().mean())


def test_the_order_of_a_ball_is_kept_by_contrast_lost_by_its_negative_and_half_kept_by_noise():
    grey, alpha = shaded()
    ball_seen = over_white(grey[..., None].expand(-1, -1, 3), alpha)
    assert order(grey, alpha, ball_seen) == 1
    assert order(shaded(power=2.2)[0], alpha, ball_seen) > 0.99
    assert order(0.3 * grey, alpha, ball_seen) > 0.99
    assert order(1 - grey, alpha, ball_seen) < 0.01
    noise = [torch.rand(SIDE, SIDE, generator=torch.Generator().manual_seed(seed)) for seed in range(20)]
    assert sum(order(each, alpha, ball_seen) for each in noise) / 20 == pytest.approx(0.5, abs=0.05)


def test_the_white_behind_an_object_is_no_edge():
    """Less opacity brings white into the picture, most of all on the rim."""
    grey, alpha = shaded()
    soft = 0.7 * alpha
    reference = over_white(grey[..., None].expand(-1, -1, 3), alpha)
    assert order(grey, soft, reference) == pytest.approx(1, abs=1e-3)
    assert not len(keeps_order(over_white(torch.zeros(3), 0.3 * alpha), reference))


def plain(palette, middle):
    """A ball of one colour."""
    model = ball(opacity=4.0)
    p = model.parameters
    flat = {"colors": torch.zeros_like(p["colors"]), "texels": torch.zeros_like(p["texels"])}
    place = {"means": p["means"] + torch.tensor([middle, 0.0, 0.0]), "palette": torch.tensor(palette)}
    return Surfels({**p, **flat, **place}, model.shading)


@pytest.fixture
def files(tmp_path):
    """Scenes of an orange and a blue ball: as fitted, with colours exchanged, and of the orange one alone."""
    paths = {
        name: write_model(tmp_path / name, plain(*each))
        for name, each in {"low": (ORANGE, -0.5), "high": (BLUE, 0.5)}.items()
    }
    fitted = Scene({name: SceneModel(path) for name, path in paths.items()})
    edits = {"low": PartEdit(palette=BLUE), "high": PartEdit(palette=ORANGE)}
    exchanged = {name: replace(each, edit=edits[name]) for name, each in fitted.models.items()}
    scenes = {
        "fitted": fitted,
        "exchanged": replace(fitted, models=exchanged),
        "alone": Scene({"low": fitted.models["low"]}),
    }
    for name, scene in scenes.items():
        write_scene(tmp_path / f"{name}.yaml", scene)
    return {name: tmp_path / f"{name}.yaml" for name in scenes}


def test_a_scene_is_measured_beside_the_one_before(files):
    values = values_of(subject(files["fitted"], files["exchanged"], files["fitted"]), [METRIC])
    assert values["hue_told_before"] == 1
    assert values["hue_told"] == 0
    assert values["depth_order"] > 0.9, "without a volume, that of the scene before"
    assert "depth_order_before" not in values
    alone = values_of(subject(*[files["alone"]] * 3), [METRIC])
    assert alone == {"depth_order": 1.0}, "one function has nothing to tell"


def test_colours_of_segments_are_those_of_their_function(files, tmp_path):
    given = subject(*[files["fitted"]] * 3)
    models = dict(given.after.models)
    models["low"] = replace(
        models["low"], segments={"own": SceneSegment(tmp_path / "mask", PartEdit(palette=BLUE))}
    )
    found = legend_colors(replace(given, scenes=(replace(given.after, models=models), given.after)))
    assert {name: len(colors) for name, colors in found.items()} == {"low": 2, "high": 1}


def test_shares_of_another_field_are_those_of_its_geometry_with_its_edits(files, tmp_path):
    before = subject(*[files["fitted"]] * 3)
    expected = shares_of(before, 0, ["high", "low"])
    alpha = before.shown.render(before.some[0]).alpha
    torch.testing.assert_close(expected[0].sum(-1), alpha, atol=1e-5, rtol=0)
    file = write_gaussians(tmp_path / "gaussians", gaussians(20))
    models = {"low": SceneModel(file), "high": SceneModel(file, PartEdit(visible=False))}
    write_scene(tmp_path / "other.yaml", Scene(models))
    other = subject(*[tmp_path / "other.yaml"] * 2, files["fitted"])
    (share, *_) = shares_of(other, 1, ["high", "low"])
    assert share[..., 0].max() == 0
    assert (share[..., 1] - expected[0][..., 1]).min() > -1e-5, "what hid it is hidden"
    assert shares_of(subject(*[tmp_path / "other.yaml"] * 3), 0, ["high", "low"]) == []
    (share, *_) = shares_of(subject(files["fitted"], tmp_path / "other.yaml", files["alone"]), 1, ["low"])
    assert share.max() > 0.5, "a geometry that lacks a model"


def test_a_volume_shows_light_alone_whatever_its_colours(files, tmp_path):
    volume = sphere_volume(tmp_path, low=LOW, high=HIGH)
    given = subject(files["fitted"], files["exchanged"], files["fitted"])
    cuts = Cuts((Plane((1.0, 0.0, 0.0), 0.0),))
    scenes = [replace(scene, volume=volume) for scene in given.scenes]
    hidden = replace(scenes[0].light, occlusion=1.0)
    first = replace(scenes[0], background=(0.0, 0.0, 0.0), cuts=cuts, light=hidden)
    bare = replace(given, scenes=(first, scenes[1]))
    for one, other in zip(under_light_alone(bare, 0), under_light_alone(bare, 1), strict=True):
        torch.testing.assert_close(one.color, other.color)
        torch.testing.assert_close(one.color, one.color[..., :1].expand(-1, -1, 3))
        assert one.alpha.max() > 0
    assert {"depth_order", "depth_order_before"} <= values_of(bare, [METRIC]).keys()
    models = {name: replace(each, edit=PartEdit(opacity=0.1)) for name, each in scenes[1].models.items()}
    faint = under_light_alone(replace(given, scenes=(scenes[0], replace(scenes[1], models=models))), 1)
    assert faint[0].alpha.sum() < 0.8 * one.alpha.sum()


def test_the_volume_is_that_before_whatever_an_edit_starts_from(files, tmp_path):
    """Such as a file of a scene that names another volume, or none, and has a model more."""
    volume = sphere_volume(tmp_path, low=LOW, high=HIGH)
    given = subject(*[files["fitted"]] * 3)
    before = replace(given.scenes[0], volume=volume)
    expected = under_light_alone(replace(given, scenes=(before, before)), 1)
    more = {"more": given.after.models["high"], **given.after.models}
    for other in (None, replace(volume, file=tmp_path / "gone.nrrd")):
        after = replace(given.after, models=more, volume=other)
        both = given.compositions[0], after.open()
        measured = replace(given, scenes=(before, after), compositions=both)
        assert torch.equal(under_light_alone(measured, 1)[0].color, expected[0].color)
        assert {"depth_order", "depth_order_before"} <= values_of(measured, [METRIC]).keys()


def test_a_real_volume_keeps_its_order_in_its_colours_and_loses_it_under_stripes(files, tmp_path):
    prepare(open_source(real_data("volumes/fuel.nii.gz")), tmp_path / "volume.nrrd")
    values = open_grid(tmp_path / "volume.nrrd").values
    ends = float(values.min()), float(values.max())
    tfs = {name: tf.scaled(*ends) for name, tf in {"low": LOW, "high": HIGH}.items()}
    given = subject(*[files["fitted"]] * 3)
    scene = replace(given.after, volume=SceneVolume(tmp_path / "volume.nrrd", tfs, LOOK))
    given = replace(given, scenes=(scene, scene), cameras=[c.resized(128) for c in given.cameras])
    stripes = 0.3 + 0.7 * (torch.arange(128) % 8 < 4).float()[:, None]
    kept, striped = [], []
    for camera, light in zip(given.some, under_light_alone(given, 1), strict=True):
        shown = Twin(scene).render(camera, scene, given.shown.palettes)
        matter = shown.color - (1 - shown.alpha[..., None])
        stripy = over_white(stripes * matter / shown.alpha[..., None].clamp_min(1e-6), shown.alpha)
        kept.append(keeps_order(shown, light))
        striped.append(keeps_order(stripy, light))
    of_colors, of_stripes = (float(torch.cat(each).float().mean()) for each in (kept, striped))
    assert of_colors > 0.95
    assert 0.5 < of_stripes < of_colors - 0.1
