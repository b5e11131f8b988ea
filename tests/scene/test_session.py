"""A scene that is edited: changes, their history, what a pixel shows."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.fields.surfels.test_composition import CAMERA, ball
from tests.fields.voxels.test_voxels import ball as voxels
from tests.refusals import refused
from tests.scene.balls import balls_in_a_volume
from tests.scene.test_twin import LOW, sphere_volume
from texgs.core.cuts import Box, Cuts, Plane
from texgs.core.light import Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.variants import write_texture
from texgs.fields.voxels import write_voxels
from texgs.scene.changes import apply_all
from texgs.scene.parts import NewLook
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.segment_file import write_segment
from texgs.scene.session import Session


@pytest.fixture
def session(tmp_path):
    """Two balls, the second of which has another place."""
    models = {}
    for index, name in enumerate(("left", "v1.2/right")):
        models[name] = SceneModel(write_model(tmp_path / f"{index}.safetensors", ball(index + 1)))
    return Session(Scene(models))


def masks():
    """Halves of the left ball."""
    even = torch.arange(len(ball(1))) % 2 == 0
    return even, ~even


def half(tmp_path):
    return write_segment(tmp_path / "half", ball(1), masks()[0])


def test_twins_of_two_volumes_are_kept_beside_each_other(session, tmp_path):
    scenes = []
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        volume = sphere_volume(tmp_path / name, **dict.fromkeys(session.scene.models, LOW))
        scenes.append(replace(session.scene, volume=volume))
    twins = [session.twin_of(scene) for scene in scenes]
    assert twins[0] is not twins[1]
    assert [session.twin_of(scene) for scene in scenes] == twins, "a page may show another step than a film"


def test_frames_are_those_of_a_scene_that_was_written_so(session, tmp_path):
    session.set("left", "palette", (0.9, 0.1, 0.2))
    session.set("v1.2/right", "opacity", 0.5)
    session.set_light(Light("directional", 30.0, 40.0))
    session.set_of_scene("background", "#000000")
    written = Session.open(session.save(tmp_path / "new.yaml"))
    assert written.scene == session.scene
    assert np.array_equal(written.frame(CAMERA), session.frame(CAMERA))
    assert session.frame(CAMERA)[0, 0].tolist() == [0, 0, 0]


def test_numbers_read_no_file_again_and_files_do(session, tmp_path):
    before = session.composition
    session.set("left", "diffuse", 0.5)
    assert session.composition is before
    session.set_file("left", "texture", write_texture(tmp_path / "a", ball(1)))
    assert session.composition is not before


def test_each_change_is_undone_and_made_again(session, tmp_path):
    scenes = [session.scene]
    for change in (
        lambda: session.set("left", "visible", False),
        lambda: session.add_segment("left/shell", half(tmp_path)),
        lambda: session.set("left/shell", "opacity", 0.25),
        lambda: session.remove_segment("left/shell"),
        lambda: session.reset("left", "visible"),
    ):
        change()
        scenes.append(session.scene)
    assert scenes[-1] == scenes[0]
    for scene in reversed(scenes[:-1]):
        assert session.undo()
        assert session.scene == scene
    assert not session.undo()
    for scene in scenes[1:]:
        assert session.redo()
        assert session.scene == scene
    assert not session.redo()
    session.undo()
    session.set("left", "diffuse", 2)
    assert not session.redo(), "another way was taken"


def test_the_oldest_of_many_steps_stay_made(session):
    for count in range(250):
        with session.one_step(str(count)):
            session.set_light(Light("directional", count))
    assert session.past == [str(count) for count in range(50, 250)]
    while session.undo():
        pass
    assert session.scene.light.azimuth == 49
    assert len(session.future) == 200


def test_a_new_segment_looks_as_its_model_does_and_an_earlier_scene_as_it_was(session, tmp_path):
    first, scene = session.frame(CAMERA), session.scene
    session.set("left", "palette", (0.9, 0.1, 0.2))
    before = session.frame(CAMERA)
    assert not np.array_equal(before, first)
    session.add_segment("left/shell", half(tmp_path))
    assert np.array_equal(session.frame(CAMERA), before)
    session.set("left/shell", "visible", False)
    assert not np.array_equal(session.frame(CAMERA), before)
    assert np.array_equal(session.frame(CAMERA, scene=scene), first)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: s.set("right", "opacity", 1), r"a model of the scene \(left, v1.2/right\), got right"),
        (lambda s: s.set("left/x", "opacity", 1), r"expected a segment of left \(it has none\), got x"),
        (lambda s: s.set("left", "opasity", 1), "models.left: no such key 'opasity', did you mean opacity"),
        (lambda s: s.set("left", "opacity", -1), "models.left.opacity: "),
        (lambda s: s.set_of_scene("background", "rde"), "background: .*did you mean red"),
        (lambda s: s.set_of_scene("light", "up"), "light: "),
        (lambda s: s.set_of_scene("shadows", "dark"), "light.shadows: expected a number, got 'dark'"),
        (lambda s: s.set_of_scene("reach", 3), "light.reach: expected above 0 to 2"),
        (lambda s: s.set_of_scene("cuts", {"plane": []}), "cuts.plane: "),
        (lambda s: s.set_of_scene("models", 1), "'models'"),
        (lambda s: s.set_file("left", "texture", s.scene.models["left"].file), "models.left: "),
        (lambda s: s.add_segment("left/a.b", s.scene.models["left"].file), "expected a name without"),
        (lambda s: s.remove_segment("left"), "expected a segment to remove, got the model left"),
    ],
)
def test_a_change_that_cannot_be_made_leaves_the_scene(session, change, message):
    before = session.scene
    refused(lambda: change(session), message)
    assert session.scene is before
    assert not session.undo()


def test_shadows_are_edits_that_stay_while_the_light_moves(tmp_path):
    session = Session(balls_in_a_volume(tmp_path))
    before, first = session.scene, session.frame(CAMERA)
    apply_all(session, ["shadows=0.7", "light=30,40", "occlusion=0.5", "reach=0.3"])
    shadowed = Light("directional", 30.0, 40.0, 0.7, 0.5, 0.3)
    assert session.scene.light == shadowed
    darker = session.frame(CAMERA)
    session.set_of_scene("light", [60, 10])
    assert session.scene.light == replace(shadowed, azimuth=60.0, polar=10.0)
    session.change("", "light", None)
    assert session.scene.light == Light("headlight", shadows=0.7, occlusion=0.5, reach=0.3)
    session.undo()
    session.undo()
    apply_all(session, ["shadows=", "occlusion=", "reach="])
    assert session.scene.light == Light("directional", 30.0, 40.0)
    lighter = session.frame(CAMERA)
    assert darker.mean() < lighter.mean()
    assert (darker <= lighter).all()
    session.undo()
    session.undo()
    assert session.scene == before
    assert np.array_equal(session.frame(CAMERA), first)


@pytest.mark.parametrize("key", ["shadows", "occlusion"])
def test_shadows_need_a_volume_and_models_that_can_be_relit(session, tmp_path, key):
    before = session.scene
    refused(lambda: session.set_of_scene(key, 0.5), "light: expected the volume of the scene for shadows")
    refused(lambda: session.set_of_scene("light", {key: 0.5}), "light: expected the volume")
    assert session.scene is before
    session.set_of_scene(key, 0)
    other = Session(replace(before, light=Light("headlight", shadows=0.7, occlusion=0.5)))
    apply_all(other, ["shadows=0", "occlusion=0", "light=30,40"])  # as the sentence says
    assert other.scene.light == Light("directional", 30.0, 40.0)
    baked = {"low": SceneModel(write_voxels(tmp_path / "grid.safetensors", voxels()))}
    session = Session(Scene(baked, volume=sphere_volume(tmp_path, low=LOW)))
    refused(lambda: session.set_of_scene(key, 0.5), "expected surfels for shadows and occlusion, got voxels")


def test_a_file_that_was_written_again_is_read_again(session, tmp_path):
    file, frames = tmp_path / "half", []
    for mask in masks():
        write_segment(file, ball(1), mask)
        if frames:
            session.remove_segment("left/a")
        session.add_segment("left/a", file)
        session.set("left/a", "visible", False)
        frames.append(session.frame(CAMERA))
    assert not np.array_equal(*frames)


def test_a_new_segment_leaves_the_files_of_earlier_scenes(session, tmp_path):
    even, odd = masks()
    session.make_segment("left/a", even, tmp_path / "a", {})
    session.set("left/a", "visible", False)
    before = session.frame(CAMERA)
    session.remove_segment("left/a")
    refused(
        lambda: session.make_segment("left/b", odd, tmp_path / "a", {}), "left/b: .*/a of an earlier scene"
    )
    session.undo()
    assert np.array_equal(session.frame(CAMERA), before)


def test_a_new_segment_replaces_the_file_of_another_session(session, tmp_path):
    for mask in masks():
        other = Session(session.scene)
        other.make_segment("left/a", mask, tmp_path / "a", {})
        assert torch.equal(other.scene.models["left"].open()[1][0], mask)


def test_several_looks_are_one_step(session, tmp_path):
    files = {
        name: write_texture(tmp_path / f"texture{seed}", ball(seed))
        for seed, name in enumerate(session.scene.models, 1)
    }
    session.set_looks({name: NewLook(file) for name, file in files.items()})
    assert [entry.texture for entry in session.scene.models.values()] == list(files.values())
    assert session.undo()
    assert [entry.texture for entry in session.scene.models.values()] == [None, None]
    files["v1.2/right"] = write_texture(tmp_path / "c", ball(3, n=9))
    refused(lambda: session.set_looks({name: NewLook(file) for name, file in files.items()}), "of this model")
    assert session.scene.models["left"].texture is None


def test_a_look_takes_the_highlights_of_the_one_before_back(session, tmp_path):
    (name, *_), files = session.scene.models, [write_texture(tmp_path / f"t{k}", ball(1)) for k in (1, 2)]
    session.set(name, "specular", 3.0)
    session.set(name, "opacity", 0.5)
    session.set_looks({name: NewLook(files[0])})
    assert session.scene.models[name].edit.specular == 3.0  # the user's own
    session.set_looks({name: NewLook(files[1], {"specular": 9.0, "tint": (1.0, 0.8, 0.3)})})
    session.set_looks({name: NewLook(files[0])})
    assert session.scene.models[name].edit == PartEdit(opacity=0.5)


def test_a_segment_that_is_renamed_keeps_its_place_and_edits(session, tmp_path):
    session.add_segment("left/shell", half(tmp_path))
    session.add_segment("left/core", half(tmp_path))
    session.set("left/shell", "opacity", 0.5)
    before = session.frame(CAMERA)
    session.rename_segment("left/shell", "crust")
    segments = session.scene.models["left"].segments
    assert list(segments) == ["crust", "core"]
    assert segments["crust"].edit.opacity == 0.5
    assert np.array_equal(session.frame(CAMERA), before)
    session.rename_segment("left/core", "core")
    assert session.undo()
    assert list(session.scene.models["left"].segments) == ["shell", "core"]


@pytest.mark.parametrize(
    ("part", "name", "message"),
    [
        ("left", "x", "expected a segment to rename, got the model left"),
        ("left/none", "x", "expected a segment of left"),
        ("left/shell", "a/b", "expected a name without"),
        ("left/shell", "core", "left/core: is there already"),
    ],
)
def test_a_name_that_cannot_be_leaves_the_scene(session, tmp_path, part, name, message):
    session.add_segment("left/shell", half(tmp_path))
    session.add_segment("left/core", half(tmp_path))
    before = session.scene
    refused(lambda: session.rename_segment(part, name), message)
    assert session.scene is before


def test_words_cut_a_scene(session):
    apply_all(
        session, ["cut=x,0.25", "cut=-y,-0.5", "cut=0,3,4,1", "cut.faces=unlit", "cut.box=-1,-1,-1,1,1,1"]
    )
    planes = [Plane([1.0, 0.0, 0.0], 0.25), Plane([0.0, -1.0, 0.0], 0.5), Plane([0.0, 0.6, 0.8], 0.2)]
    assert session.scene.cuts == Cuts(planes, Box([-1.0] * 3, [1.0] * 3), "unlit")
    apply_all(session, ["cut.2=z,0", "cut.1=", "cut.box=", "cut.faces="])
    assert session.scene.cuts == Cuts([Plane([0.0, 0.0, 1.0], 0.0), planes[2]])
    apply_all(session, ["cut="])
    assert not session.scene.cuts


@pytest.mark.parametrize(
    ("words", "left"),
    [
        (["cut.1=", "cut.2="], [0.3, 0.4]),
        (["cut.4=", "cut.2=", "cut.1="], [0.3]),
        (["cut.1=", "cut.2=y,0", "cut.4="], [0.0, 0.3]),
        (["cut.1=", "cut=y,0", "cut=y,-0.1", "cut=y,-0.2", "cut.4="], [0.2, 0.3, 0.0, -0.1, -0.2]),
        (["cut.1=", "cut=", "cut=y,0"], [0.0]),
    ],
)
def test_planes_have_the_numbers_of_before_all_words(session, words, left):
    apply_all(session, [f"cut=x,0.{each}" for each in (1, 2, 3, 4)])
    apply_all(session, words)
    assert [plane.offset for plane in session.scene.cuts.planes] == left


@pytest.mark.parametrize(
    ("word", "message"),
    [
        *((f"cut={word}", f"cut={word}: .* AXIS,POS") for word in ("w,0.1", "x,up", "x,nan", "1,2,3")),
        ("cut=x,5v", "cut=x,5v: expected world units"),
        ("cut=0,0,0,1", "normal: "),
        ("cut.2=x,0", "cut.1, got cut.2"),
        ("cut=x,9", r"cut=x,9: .* from -0\.\d+ to 0\.\d+ along 1,0,0"),
        ("cut=-x,9", "along -1,0,0, got -9"),
        ("cut.1=0,1,1,9", "along 0,0.707,0.707, got 6.36"),
        ("cut.box=4,4,4,5,5,5", "along -1,0,0, got -4"),
        ("cuts=x,0", "'cuts', did you mean cut?"),
        (
            "sun=3",
            "'sun'; expected light, shadows, .*reach, background, functions, time, cut, marker, distance$",
        ),
        ("cut.box=1,2,3", "X0,Y0,Z0,X1,Y1,Z1, .* got 1,2,3"),
        ("cut.faces=dark", "faces: .* dark"),
    ],
)
def test_a_word_that_cannot_cut_leaves_the_scene(session, word, message):
    apply_all(session, ["cut=x,0.25"])
    before = session.scene
    refused(lambda: apply_all(session, [word]), message)
    assert session.scene is before


def test_a_box_may_be_larger_than_the_models_and_other_cuts_are_left_alone(session):
    session.set_cuts(Cuts([Plane([1.0, 0.0, 0.0], 9.0)]))  # as a page drags it
    apply_all(session, ["cut.box=-9,-9,-9,0,9,9", "cut.faces=unlit", "cut=x,0"])
    assert [plane.offset for plane in session.scene.cuts.planes] == [9.0, 0.0]
