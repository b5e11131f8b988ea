"""New looks of a scene that is edited meanwhile, and what is left where they fail or are stopped."""

import pytest
import torch

from tests.scene.balls import write_balls
from texgs.core.errors import ArgumentError
from texgs.core.progress import watching
from texgs.edit.new_look import give_look, look_task, settings_of
from texgs.scene.session import Session


class Cancelled(Exception):
    """Raised where work can be stopped."""


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr("texgs.edit.new_look.VIEWS", 12)
    monkeypatch.setattr("texgs.edit.new_look.SIDE", 96)


@pytest.fixture
def session(tmp_path):
    return Session.open(write_balls(tmp_path / "balls"))


def dots(session, output, parts=("TF01",)):
    settings = settings_of("image", {"style": "dots", "recipe": "preview"})
    return look_task(session.scene, settings, parts, output, torch.device("cpu"))


def stop(title, done, total):
    if title == "look":
        raise Cancelled


def test_a_look_that_is_stopped_when_all_is_learned_leaves_what_was_there(session, tmp_path):
    before, there = session.scene, tmp_path / "there"
    there.mkdir()
    for folder in (there / "look", tmp_path / "new" / "look"):
        with watching(stop), pytest.raises(Cancelled):
            give_look(session, dots(session, folder), "dots")
    assert session.scene is before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["balls", "there"]
    assert not [*there.iterdir()]


@pytest.mark.parametrize("folder", ["balls", "balls/scene.yaml/look"])
def test_a_look_replaces_no_folder_of_others(session, tmp_path, folder):
    files = sorted(tmp_path.rglob("*"))
    with pytest.raises(ArgumentError, match=f"{folder}: cannot be written"):
        give_look(session, dots(session, tmp_path / folder), "dots")
    assert sorted(tmp_path.rglob("*")) == files


def test_parts_that_are_gone_get_no_look(session, tmp_path):
    mask = torch.arange(len(session.scene.models["TF01"].surfels()[0])) % 2 == 0
    session.make_segment("TF01/half", mask, tmp_path / "half", {})
    task = dots(session, tmp_path / "look", ["TF01/half", "TF02"])
    session.rename_segment("TF01/half", "core")
    assert give_look(session, task, "dots").gone == ["TF01/half"]
    assert session.past[-1] == "TF02 dots"
    assert session.scene.models["TF02"].texture.parent == tmp_path / "look"
    assert session.scene.models["TF01"].segments["core"].texture is None
