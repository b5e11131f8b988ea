from functools import partial

import pytest
import torch
from torch.testing import assert_close

from tests.fields.surfels.samples import sample
from tests.raster.agreement import images
from tests.raster.requirements import require_equal
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.light import Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import Composition, EditableModel
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel, raw_material
from texgs.fields.surfels.texels import offsets_of
from texgs.raster.reference import shading as reference
from texgs.raster.shading import MATERIAL

CAMERA = orbit(30, 20, 3, 40, 64, 48)
SIDE = Light("directional", 100, 30)
OUTPUTS = ("depth", "normal")


def ball(seed, n=150, stage="texture", shared=True, middle=0.0):
    """Random surfels on a ball, textured with up to 4x4 texels."""
    g = torch.Generator().manual_seed(seed)
    directions = torch.nn.functional.normalize(torch.randn(n, 3, generator=g), dim=1)
    p = {
        "means": 0.5 * directions + middle,
        "quats": torch.randn(n, 4, generator=g),
        "scales": torch.log(0.08 + 0.05 * torch.rand(n, 2, generator=g)),
        "opacities": torch.randn(n, generator=g),
        "colors": 0.2 * torch.rand(n, 3, generator=g),
    }
    factors = raw_material(0.4, 0.5, 0.2, 20.0, "bounded")
    p |= {name: x.repeat(1 if shared else n) for name, x in factors.items()}
    if stage == "texture":
        sizes = torch.randint(1, 5, (n, 2), generator=g, dtype=torch.int32)
        p |= {"palette": torch.rand(3, generator=g) * 0.6}
        p |= {"texels": 0.2 * torch.rand(int(sizes.prod(1).sum()), 3, generator=g)}
        p |= {"sizes": sizes, "offsets": offsets_of(sizes)}
    return Surfels(p, ShadingModel())


def union(*models):
    """One model with the surfels of all, whose material is per surfel and palette part of the offsets."""
    parts, count = [], 0
    for model in models:
        q = dict(model.parameters)
        q |= {"colors": q["colors"] + q.pop("palette"), "offsets": q["offsets"] + count}
        q |= {name: q[name].expand(len(model)) for name in MATERIAL}
        count += len(q["texels"])
        parts.append(q)
    p = {name: torch.cat([q[name] for q in parts]) for name in parts[0]}
    return Surfels({**p, "palette": torch.zeros(3)}, models[0].shading)


def test_light_and_pictures_of_normals_see_normals_of_their_own():
    model, turned = ball(1), ball(5).parameters["quats"]
    own = Surfels({**model.parameters, "normals": turned}, model.shading)
    as_planes = Surfels({**model.parameters, "quats": turned}, model.shading)
    one, other = (x.shading.colors(x.parameters, CAMERA, SIDE) for x in (own, as_planes))
    assert torch.equal(one.base, other.base)
    seen, alone = (x.render(CAMERA, SIDE, outputs=OUTPUTS) for x in (Composition([own, ball(2)]), own))
    planes, bare = (x.render(CAMERA, SIDE, outputs=OUTPUTS) for x in (Composition([model, ball(2)]), model))
    assert torch.equal(seen.depth, planes.depth)
    assert torch.equal(alone.alpha, bare.alpha)
    assert float((seen.normal - planes.normal).abs().max()) > 0.1
    assert torch.equal(Composition([own]).render(CAMERA, outputs=OUTPUTS).normal, alone.normal)
    same = Surfels({**model.parameters, "normals": model.parameters["quats"]}, model.shading)
    assert_close(same.render(CAMERA, outputs=OUTPUTS).normal, bare.normal, atol=1e-5, rtol=0)


@pytest.mark.parametrize("light", [Light("headlight"), SIDE])
def test_one_model_unedited_is_the_model_bit_for_bit(light):
    model = ball(1)
    alone = model.render(CAMERA, light, outputs=OUTPUTS)
    scene = Composition([model]).render(CAMERA, light, [PartEdit()], outputs=OUTPUTS)
    require_equal(images(scene), images(alone))


@pytest.mark.parametrize("light", [Light("headlight"), SIDE])
def test_a_scene_is_the_union_of_its_surfels(light):
    models = [ball(1), ball(2, shared=False, middle=0.2), ball(3, middle=-0.1)]
    expected = union(*models).render(CAMERA, light)
    rendered = Composition(models).render(CAMERA, light)
    assert_close(rendered.color, expected.color, atol=1e-6, rtol=0)
    assert_close(rendered.alpha, expected.alpha, atol=1e-6, rtol=0)


def test_hiding_is_removing_bit_for_bit():
    models = [ball(1), ball(2, middle=0.2), ball(3, stage="shading", middle=-0.1)]
    edits = [PartEdit(), PartEdit(visible=False), PartEdit()]
    hidden = Composition(models).render(CAMERA, SIDE, edits, outputs=OUTPUTS)
    removed = Composition([models[0], models[2]]).render(CAMERA, SIDE, outputs=OUTPUTS)
    require_equal(images(hidden), images(removed))


@pytest.mark.parametrize("opacity", [0.4, 1000.0])
def test_an_edit_is_the_model_with_other_numbers_and_at_most_opaque(opacity):
    model = ball(4)
    edit = PartEdit(True, (0.1, 0.7, 0.2), opacity, ambient=0.5, diffuse=1.5, specular=2, shininess=0.5)
    p = model.parameters
    changed = {"palette": torch.tensor(edit.palette), **raw_material(0.2, 0.75, 0.4, 10.0, "bounded")}
    changed["opacities"] = torch.logit((opacity * p["opacities"].sigmoid()).clamp_max(1 - 1e-7))
    expected = Surfels({**p, **changed}, model.shading).render(CAMERA, SIDE)
    assert_close(Composition([model]).render(CAMERA, SIDE, [edit]).color, expected.color, atol=2e-5, rtol=0)


def test_highlights_have_the_tint_of_their_part():
    """The closed form in double precision; segments have tints of their own."""
    model, first = ball(4, shared=False), torch.arange(150) < 60
    gold, blue = (1.0, 0.7, 0.3), (0.0, 0.0, 1.0)
    edits = [PartEdit(specular=3.0, shininess=0.5, tint=gold), PartEdit(specular=2.0, tint=blue)]
    part = EditableModel(model, [first])
    base, gain = part.shade(part.apply(edits), CAMERA, SIDE, "shaded")
    p = {name: x.double() for name, x in model.parameters.items()}
    k_s, beta = torch.where(first, 0.4, 0.6), torch.where(first, 20.0, 10.0)
    zero, place = torch.zeros(150).double(), CAMERA.position.double()
    light = SIDE.direction(CAMERA).double()
    rest = (p["means"], p["quats"], place, light)
    colors = p["colors"] + p["palette"]
    shade = partial(reference.blinn_phong, facing=True)
    matt, gains = shade(colors, zero + 0.4, zero + 0.5, zero, zero, *rest)
    shine, _ = shade(0 * colors, zero, zero, k_s, beta, *rest)
    tint = torch.where(first[:, None], torch.tensor(blue), torch.tensor(gold))
    assert float(shine.max()) > 0.2
    assert_close(base.double(), (matt + tint * shine).clamp(0, 1), atol=1e-5, rtol=0)
    assert_close(gain.double(), gains, atol=1e-5, rtol=0)


def test_edits_do_not_copy_texels():
    scene = Composition([ball(1), ball(2)])
    before = scene.texels.data_ptr()
    scene.render(CAMERA, SIDE, [PartEdit(palette=(1, 0, 0)), PartEdit(opacity=0.5)])
    assert scene.texels.data_ptr() == before


def test_looks_of_the_material_are_its_factors():
    """Where a surfel is opaque, blending shows what it has; factors of both models differ."""
    models = [ball(1, n=2000), ball(2, n=2000, middle=0.0)]
    edits = [PartEdit(diffuse=0.5), PartEdit(diffuse=0.5)]
    rendered = Composition(models).render(CAMERA, SIDE, edits, look="diffuse")
    assert_close(rendered.color, 0.25 * rendered.alpha[..., None].expand(-1, -1, 3), atol=1e-5, rtol=0)


@pytest.mark.parametrize(("look", "texels", "shown"), [("unshaded", 0.0, None), ("texture", 0.125, 0.625)])
def test_without_light_palette_and_texels_are_seen_or_texels_around_grey(look, texels, shown):
    p = ball(1, n=3000).parameters
    flat = {**p, "texels": torch.full_like(p["texels"], texels), "colors": torch.zeros_like(p["colors"])}
    rendered = Composition([Surfels(flat)]).render(CAMERA, SIDE, look=look, background=torch.zeros(3))
    expected = p["palette"] if shown is None else torch.full((3,), shown)
    assert_close(rendered.color, rendered.alpha[..., None] * expected, atol=1e-5, rtol=0)


def test_discs_are_opaque_within_one_standard_deviation():
    """A surfel that faces the camera covers a circle, whatever its opacity; one that is hidden nothing."""
    one = {name: x[:1] for name, x in ball(1, stage="shading").parameters.items()}
    one |= {"means": torch.zeros(1, 3), "quats": torch.tensor([[1.0, 0, 0, 0]])}
    one |= {"opacities": torch.tensor([-2.0]), "scales": torch.full((1, 2), 0.3).log()}
    scene, camera = Composition([Surfels(one, ShadingModel())]), orbit(-90, 0, 4, 30, 200, 200)
    alpha = scene.render(camera, SIDE, look="discs").alpha
    radius = 0.3 * float(camera.K[0, 0]) / 4
    assert float(alpha.max()) == pytest.approx(0.99)
    assert float((alpha > 0.5).sum()) == pytest.approx(torch.pi * radius**2, rel=0.02)
    hidden = scene.render(camera, SIDE, [PartEdit(visible=False)], look="discs").alpha
    assert float(hidden.max()) == 0


@pytest.mark.parametrize(
    ("models", "edits", "named"),
    [
        ([], None, "models: .*none"),
        ([sample("surfels")], None, "got surfels"),
        ([ball(1), Surfels(ball(2).parameters, ShadingModel(2.0))], None, "one low_pass"),
        ([ball(1)], [PartEdit(), PartEdit()], "edits: .*1 models, got 2"),
        ([ball(1, stage="shading")], [PartEdit(palette=(0, 0, 0))], "palette: "),
    ],
)
def test_what_cannot_be_composed(models, edits, named):
    refused(lambda: Composition(models).render(CAMERA, SIDE, edits), named)


OUT_OF_RANGE = [
    *({"palette": value} for value in ((1, 2, 0), "#12345g")),
    *({"tint": value} for value in ((1, 2, 0), None)),
    *({"opacity": -1}, {"diffuse": float("nan")}, {"specular": True}, {"visible": 1}),
]


@pytest.mark.parametrize("values", OUT_OF_RANGE)
def test_edits_out_of_range(values):
    refused(lambda: PartEdit(**values), f"{next(iter(values))}: expected")


def test_hexadecimal_colours():
    assert PartEdit(palette="#ff0080").palette == pytest.approx((1, 0, 128 / 255))
