"""How opaque parts become with a new look: as readable as asked for, and what is inside stays visible."""

from dataclasses import replace

import torch

from tests.edit.scenes import ball, on_sphere, sphere_points, task
from tests.fields.test_sizes import gaussians
from tests.refusals import refused
from texgs.edit.methods.image import ImageKeys
from texgs.edit.methods.text import TextKeys
from texgs.edit.readable import (
    KEPT_SHARE,
    MAX_READABLE_FACTOR,
    READABLE_ALPHA,
    SHOWN_SHARE,
    SIZE,
    VIEWS,
    raise_opacities,
    readable_factors,
)
from texgs.fields.gaussians import write_gaussians
from texgs.fields.part_edit import PartEdit
from texgs.fields.splats import geometry
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.raster import rasterize
from texgs.scene.scene import Scene, SceneModel, SceneSegment
from texgs.scene.segment_file import write_segment
from texgs.volume.cameras import icosphere_of

FAINT = -2.2  # raw opacity: 0.1


def scene_of(folder, edits=None, **models):
    """A scene of models in files."""
    edits = edits or {}
    return Scene(
        {
            name: SceneModel(write_model(folder / name, model), edits.get(name, PartEdit()))
            for name, model in models.items()
        }
    )


def sized(radius, opacity):
    """A ball like `ball` of another radius."""
    model = ball(opacity=opacity)
    points = sphere_points(len(model))
    other = on_sphere(points, radius, 1.6 * radius / len(model) ** 0.5, opacity)
    return Surfels({**model.parameters, **other}, model.shading)


def shares(scene, factors):
    """What views show of each model [V, P, H, W], by the rasterizer alone: its share of each pixel."""
    models = {name: entry.open()[0] for name, entry in scene.models.items()}
    parts = [geometry(model.parameters) for model in models.values()]
    means, quats, scales, opacities = (torch.cat(x) for x in zip(*parts, strict=True))
    counts = [len(model) for model in models.values()]
    factor = torch.cat(
        [torch.full((n,), factors.get(name, 1.0)) for name, n in zip(models, counts, strict=True)]
    )
    features = torch.nn.functional.one_hot(torch.arange(len(models)).repeat_interleave(torch.tensor(counts)))
    frames = []
    for camera in icosphere_of(2 * VIEWS, scene.framed().lens().square(SIZE))[::2]:
        frames.append(
            rasterize(
                *(means, quats, scales, (opacities * factor).clamp_max(1)),
                *(camera.viewmat, camera.K, camera.width, camera.height),
                features=features.float(),
                options=next(iter(models.values())).shading.options,
            ).color.permute(2, 0, 1)
        )
    return torch.stack(frames)


def alpha_of(scene, factors):
    alpha = shares(scene, factors).sum(1)
    return float(alpha.square().sum() / alpha.sum())


def test_a_faint_part_becomes_as_opaque_as_is_readable_and_not_more(tmp_path):
    scene = scene_of(tmp_path, shell=ball(opacity=FAINT))
    (factor,) = readable_factors(scene, ["shell"], "cpu").values()
    assert 1.5 < factor < MAX_READABLE_FACTOR
    assert (
        alpha_of(scene, {"shell": factor / 1.15}) < READABLE_ALPHA < alpha_of(scene, {"shell": 1.05 * factor})
    )


def test_an_opaque_part_stays_as_it_is_and_one_that_never_is_readable_gets_the_largest_factor(tmp_path):
    scene = scene_of(tmp_path, solid=ball(), veil=ball(opacity=-5.0))
    assert readable_factors(scene, ["solid"], "cpu") == {"solid": 1.0}
    assert readable_factors(scene_of(tmp_path, veil=ball(opacity=-5.0)), ["veil"], "cpu") == {
        "veil": MAX_READABLE_FACTOR
    }


def test_a_part_that_was_edited_to_a_high_opacity_gets_no_more_than_there_is(tmp_path):
    scene = scene_of(tmp_path, {"veil": PartEdit(opacity=100.0)}, veil=ball(opacity=-9.0))
    given = replace(task(scene, tmp_path, ["veil"]), settings=ImageKeys(opacity="auto"))
    assert 100 <= raise_opacities(given).scene.models["veil"].edit.opacity <= 1000


def test_what_is_inside_keeps_half_of_its_pixels(tmp_path):
    """Three faint shells, each readable alone, would hide the core together."""
    shells = {name: sized(radius, FAINT) for name, radius in (("a", 0.5), ("b", 0.55), ("c", 0.6))}
    scene = scene_of(tmp_path, core=sized(0.2, 4.0), **shells)
    alone = {
        name: readable_factors(scene_of(tmp_path, x=each), ["x"], "cpu")["x"] for name, each in shells.items()
    }
    factors = readable_factors(scene, list(scene.models), "cpu")
    before = (shares(scene, {})[:, 0] > SHOWN_SHARE).sum()

    def kept(factors):
        return float((shares(scene, factors)[:, 0] > SHOWN_SHARE).sum() / before)

    assert kept(alone) < KEPT_SHARE
    assert factors["core"] == 1.0
    assert all(1 < factors[name] < alone[name] for name in shells)
    assert kept(factors) >= KEPT_SHARE > kept({name: 1.25 * factors[name] for name in shells})


def test_models_without_texture_stay_visible_too_and_other_fields_are_refused(tmp_path):
    names = {"texels", "sizes", "offsets", "palette"}
    core = sized(0.2, 4.0)
    plain = {name: x for name, x in core.parameters.items() if name not in names}
    shells = {name: sized(radius, FAINT) for name, radius in (("a", 0.5), ("b", 0.55), ("c", 0.6))}
    textured, mixed = (
        readable_factors(scene_of(tmp_path, core=each, **shells), list(shells), "cpu")
        for each in (core, Surfels(plain, core.shading))
    )
    assert textured == mixed
    other = Scene({"x": SceneModel(write_gaussians(tmp_path / "gaussians", gaussians(20)))})
    refused(lambda: readable_factors(other, ["x"], "cpu"), "expected surfels, got gaussians")


def test_segments_of_a_model_have_factors_of_their_own(tmp_path, monkeypatch):
    """Its half in front is faint; the other has a mean alpha of 0.87, for its surfels have soft rims."""
    monkeypatch.setattr("texgs.edit.readable.READABLE_ALPHA", 0.8)
    model = ball()
    front = model.parameters["means"][:, 2] > 0
    opacities = torch.where(front, FAINT, 4.0)
    scene = scene_of(tmp_path, x=Surfels({**model.parameters, "opacities": opacities}, model.shading))
    file = write_segment(tmp_path / "front.safetensors", scene.models["x"].open()[0], front)
    parts = replace(scene.models["x"], segments={"front": SceneSegment(file)})
    factors = readable_factors(replace(scene, models={"x": parts}), ["x", "x/front"], "cpu")
    assert factors["x"] == 1.0 < factors["x/front"]


def test_the_factor_is_on_top_of_what_was_edited_and_only_of_parts_that_are_styled(tmp_path):
    edits = {"shell": PartEdit(opacity=0.5, diffuse=2.0), "other": PartEdit(opacity=0.25)}
    scene = scene_of(tmp_path, edits, shell=ball(opacity=FAINT), other=ball(opacity=FAINT))
    for opacity, expected in (("4", 2.0), ("keep", 0.5)):
        given = replace(task(scene, tmp_path, ["shell"]), settings=ImageKeys(opacity=opacity))
        edited = raise_opacities(given).scene
        assert edited.models["shell"].edit == PartEdit(opacity=expected, diffuse=2.0)
        assert edited.models["other"] == scene.models["other"]


def test_opacity_is_a_word_or_a_factor():
    factors = {said: ImageKeys(opacity=said).factor for said in (None, "auto", "keep", "2.5")}
    assert factors == {None: None, "auto": None, "keep": 1.0, "2.5": 2.5}
    assert ImageKeys(recipe="paper").factor == TextKeys(recipe="paper").factor == 1.0
    assert ImageKeys(recipe="paper", opacity="auto").factor is None
    for said in ("much", "0", "1001", "nan"):
        refused(ImageKeys(opacity=said).check, "edit.image.opacity: expected keep, auto or a factor above 0")
    refused(TextKeys(opacity="x", instruction="gold", guidance="filters").check, "edit.text.opacity: .* 'x'")
