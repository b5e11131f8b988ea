"""Highlights of materials that instructions name: what they become, and what leaves them alone."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from tests.edit.scenes import AnyViews, shell
from tests.fields.surfels.test_composition import ball
from texgs.core.lens import Lens
from texgs.core.light import HEADLIGHT
from texgs.edit.keys import EditKeys
from texgs.edit.methods.text import METHOD, TextKeys
from texgs.edit.readable import MATERIALS, highlights_of
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import EditableModel
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.scene.changes import apply_all
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.session import Session
from texgs.volume.cameras import icosphere_of
from texgs.volume.view_set import View


class FromAround(AnyViews):
    """An edit with cameras of which views are made anew."""

    def training_views(self, model):
        return [View(camera, Path(), HEADLIGHT) for camera in icosphere_of(12, self.lens)]


@pytest.mark.parametrize("name", MATERIALS)
def test_the_middle_of_a_part_gets_the_highlights_of_the_material(name):
    model = ball(1, n=151, shared=False)
    raw = model.parameters["specular"] + torch.linspace(-1, 1, 151)
    model = Surfels({**model.parameters, "specular": raw}, model.shading)
    outer = torch.arange(151) < 75
    edit = PartEdit(**highlights_of(f"make it {name}", model, outer))
    _, _, specular, shininess = EditableModel(model).apply([edit]).material
    assert float(specular[outer].median()) == pytest.approx(MATERIALS[name].specular)
    assert float(shininess[outer].median()) == pytest.approx(MATERIALS[name].shininess)
    assert edit.tint == MATERIALS[name].tint


def test_a_part_without_highlights_keeps_none_as_no_factor_makes_them():
    model = ball(1)
    dull = Surfels({**model.parameters, "specular": torch.tensor([-torch.inf])}, model.shading)
    assert highlights_of("gold", dull).keys() == {"tint", "shininess"}


@pytest.mark.parametrize(
    "words", ["a watercolour", "make it blue", "not gold", "as a statue of a king", "oil on gold"]
)
def test_words_that_name_no_material_set_nothing(words):
    assert highlights_of(words, ball(1)) == {}


def test_the_recipe_of_the_paper_sets_nothing_unless_it_is_asked_to():
    assert TextKeys().recipe_of().material
    assert not TextKeys(recipe="paper").recipe_of().material
    assert TextKeys(recipe="paper", material=True).recipe_of().material


@pytest.mark.parametrize(
    ("settings", "is_set"),
    [({}, True), ({"material": False}, False), ({"instruction": "make it blue"}, False)],
)
def test_an_edit_by_words_sets_highlights_which_words_take_back(settings, is_set, tmp_path):
    file = write_model(tmp_path / "shell", shell())
    scene = Scene({"shell": SceneModel(file, edit=PartEdit(opacity=0.9, diffuse=0.5))})
    keys = replace(TextKeys(instruction="make it gold", guidance="filters", size=64), **settings)
    edit = EditKeys("gold", parts=[])
    done = FromAround(keys, edit, scene, {}, tmp_path, torch.device("cpu"), 1, Lens().square(64), "test")
    session = Session(METHOD.run(done).scene)
    before, after = scene.models["shell"].edit, session.scene.models["shell"].edit
    wanted = highlights_of("gold", shell()) if is_set else {}
    assert after == replace(before, **wanted)
    apply_all(session, ["shell.tint=#ff8000"])
    assert session.scene.models["shell"].edit.tint == (1, 128 / 255, 0)
    apply_all(session, [f"shell.{key}=" for key in ("specular", "shininess", "tint")])
    assert session.scene.models["shell"].edit == before
