"""What holds for all fields with light in their colours: a scene of them changes their opacity alone."""

import pytest
import torch

from tests.fields.gaussians.samples import sample
from tests.fields.palette.test_palette import box
from tests.fields.voxels.test_voxels import ball
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.errors import ConfigError, TexgsError
from texgs.core.light import Light
from texgs.fields.kinds import kinds, require
from texgs.fields.part_edit import PartEdit
from texgs.raster.shading import MATERIAL

CAMERA = orbit(30, 20, 4, 30, 48, 40)
FIELDS = {"gaussians": lambda: sample(40), "palette": lambda: box(scale=1.0), "voxels": ball}


def compose(fields, segments=()):
    return kinds()[fields[0].kind].compose(fields, segments)


@pytest.fixture(params=FIELDS)
def field(request):
    return FIELDS[request.param]()


@pytest.mark.parametrize("edits", [None, [PartEdit()]])
def test_a_scene_of_one_is_the_field_bit_for_bit(field, edits):
    alone = field.render(CAMERA, outputs=("depth",))
    scene = compose([field])
    shown = scene.render(CAMERA, Light("directional", 100, 30), edits, outputs=("depth",))
    assert all(
        torch.equal(getattr(shown, name), getattr(alone, name)) for name in ("color", "alpha", "depth")
    )
    assert (len(scene), str(scene.device), scene.palettes) == (len(field), "cpu", [(0.0, 0.0, 0.0)])


def test_light_changes_nothing_and_the_background_is_white_unless_told(field):
    rendered, grey = field.render(CAMERA, Light("directional", 100, 30)), torch.tensor([0.1, 0.2, 0.3])
    assert torch.equal(rendered.color, field.render(CAMERA).color)
    empty = rendered.alpha == 0
    assert bool((rendered.color[empty] == 1).all())
    assert bool((field.render(CAMERA, background=grey).color[empty] == grey).all())
    hidden = compose([field]).render(CAMERA, edits=[PartEdit(visible=False)], background=grey)
    assert bool((hidden.color == grey).all())


OF_SURFELS = {"palette": (1, 0, 0), "tint": (1, 1, 0), **dict.fromkeys(MATERIAL, 0.5)}


@pytest.mark.parametrize("name", OF_SURFELS)
def test_other_edits_are_refused(field, name):
    scene, edits = compose([field]), [PartEdit(**{name: OF_SURFELS[name]})]
    refused(lambda: scene.render(CAMERA, edits=edits), f"{name}: .*{field.kind}")


def test_what_cannot_be_shown_is_refused(field):
    scene, mask = compose([field]), torch.ones(7)
    for edits in ([], [PartEdit()] * 2):
        refused(lambda edits=edits: scene.render(CAMERA, edits=edits), "edits: .*1 models", TexgsError)
    refused(lambda: scene.render(CAMERA, look="diffuse"), f"look: .*{field.kind}", TexgsError)
    refused(lambda: field.render(CAMERA, outputs=("normal",)), "outputs: |no normal", TexgsError)
    refused(lambda: type(scene)([]), "models: ", TexgsError)
    refused(lambda: compose([field], [[mask]]), f"segments: .*{field.kind}", TexgsError)
    refused(
        lambda: require(field.kind, {"palette"}, "edit=crimson"), f"edit=crimson.*{field.kind}", ConfigError
    )
