"""Editors behind the method `text`, on a ball: by name, by folder and by address, and what is no editor."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch
from PIL import Image
from torch.testing import assert_close

from tests.edit.scenes import AnyViews, around, ball
from tests.models.servers import served
from tests.models.tiny_pipelines import save_klein, save_sdxl
from tests.refusals import refused
from tests.toys.editor import Editor
from texgs.core.lens import Lens
from texgs.edit.keys import EditKeys
from texgs.edit.methods.text import METHOD, TextKeys
from texgs.edit.methods.updates import In2nKeys
from texgs.fields.surfels.model_file import write_model
from texgs.models.catalogue import PIPELINES
from texgs.models.editors import Endpoint, ImagePipeline
from texgs.models.filters import ProceduralFilters
from texgs.scene.scene import Scene, SceneModel
from texgs.volume.view_set import View

CPU = torch.device("cpu")
KEYS = TextKeys(instruction="turn it into gold", size=64, steps=2)


@dataclass(frozen=True, eq=False)
class AroundTheBall(AnyViews):
    def training_views(self, model):
        return [View(camera, None, self.scene.light) for camera in around(4)]


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A folder of weights with two tiny pipelines, by their names in the catalogue."""
    pytest.importorskip("diffusers")
    folder = tmp_path_factory.mktemp("weights")
    save_sdxl(folder / "sdxl-instruct-pix2pix")
    save_klein(folder / "flux2-klein")
    return folder


def edited(folder, guidance):
    """Edit a ball; return its texels, how it was done, and views.png."""
    scene = Scene({"ball": SceneModel(write_model(folder / "ball.safetensors", ball(120, 3)))})
    settings = replace(KEYS, guidance=guidance)
    settings.check()
    task = AroundTheBall(settings, EditKeys("test"), scene, {}, folder / "edited", CPU, 1, Lens(), "test")
    done = METHOD.run(task)
    model, _ = done.scene.models["ball"].surfels()
    with Image.open(folder / "edited" / "views.png") as picture:
        return model.parameters["texels"], done.how, np.asarray(picture)


def test_a_pipeline_edits_a_ball_by_its_name_and_by_its_folder_alike(folders, tmp_path, monkeypatch):
    name = "flux2-klein"
    monkeypatch.setenv("TEXGS_WEIGHTS", str(folders))
    monkeypatch.setitem(PIPELINES, name, replace(PIPELINES[name], numbers={"size": 64}))
    texels, how, views = edited(tmp_path / "name", name)
    assert how == f"{name}, default"
    assert bool((texels != 0).any())
    again, how, same = edited(tmp_path / "folder", str(folders / name))
    assert how == f"{folders / name}, default"
    assert torch.equal(texels, again)
    assert np.array_equal(views[40:], same[40:]), "below the titles"


class Inverts:
    """What the server of the documentation does."""

    name, lit = "inverts", True

    def __call__(self, views, instruction, generator):
        torch.randint(2**31, (), generator=generator)  # the seed that goes to the server
        return 1 - (255 * views.images).round() / 255


def test_a_server_edits_a_ball_as_the_same_guidance_without_one(tmp_path, monkeypatch):
    with served(Editor) as address:
        texels, how, _ = edited(tmp_path / "server", address)
    assert how == f"{address}, default"
    monkeypatch.setattr(TextKeys, "opened", lambda keys, device: Inverts())
    expected, *_ = edited(tmp_path / "none", "filters")
    assert_close(texels, expected, atol=1e-5, rtol=1e-5)


def test_each_kind_of_guidance_is_opened_with_what_is_given(folders, monkeypatch):
    monkeypatch.setenv("TEXGS_WEIGHTS", str(folders))
    opened = []
    monkeypatch.setattr(ImagePipeline, "open", lambda *given, **options: opened.append((given, options)))
    replace(KEYS, guidance="flux2-klein", steps=None).opened(CPU)
    replace(KEYS, guidance="sdxl-instruct-pix2pix", image_scale=2.0).opened(CPU)
    klein, sdxl = opened
    assert klein == (
        (folders / "flux2-klein", "flux2-klein", CPU),
        {"size": 1024, "steps": 4, "text_scale": 1.0},
    )
    assert sdxl[1] == {"size": 768, "steps": 2, "text_scale": 3.0, "image_scale": 2.0}
    server = replace(KEYS, guidance="https://example.org/x", negative="fog").opened(CPU)
    assert isinstance(server, Endpoint)
    assert (server.name, server.options) == ("https://example.org/x", {"steps": 2, "negative": "fog"})
    assert isinstance(replace(KEYS, guidance="filters").opened(CPU), ProceduralFilters)


def test_what_an_edit_needs_is_known_before_it_runs(folders):
    pinned = f"someone/editor@{'0' * 40}"
    for name, weights in (
        ("instruct_pix2pix", {"instruct-pix2pix": "guidance=filters"}),
        ("flux2-klein", {"flux2-klein": "guidance=filters"}),
        (pinned, {pinned: "guidance=filters"}),
        *((each, {}) for each in ("filters", "http://localhost:8000", str(folders / "flux2-klein"))),
    ):
        keys = replace(KEYS, guidance=name)
        keys.check()
        assert keys.weights() == weights
        assert bool(keys.files()) == name.startswith(str(folders))
    files = keys.files().values()
    assert folders / "flux2-klein" / "model_index.json" in files
    assert set((folders / "flux2-klein").glob("*/*.safetensors")) <= set(files)


@pytest.mark.parametrize(
    "guidance",
    ["flux2_klein", "someone/editor@main", "ftp://example.org", "", "no/such/folder"],
)
def test_what_is_no_editor_is_refused_with_all_that_there_are(guidance):
    named = f"edit.text.guidance: expected instruct_pix2pix, .*@REVISION .*, got {guidance!r}"
    refused(replace(KEYS, guidance=guidance).check, named)


def test_weights_of_a_loss_are_no_editor(folders, monkeypatch):
    monkeypatch.setenv("TEXGS_WEIGHTS", str(folders))
    opened = []
    monkeypatch.setattr(ImagePipeline, "open", lambda *given, **options: opened.append(given))
    keys = In2nKeys(instruction="turn it into gold", guidance="filters", lpips=1.0)
    assert set(keys.weights()) == {"vgg16", "lpips_vgg"}
    assert isinstance(keys.opened(CPU), ProceduralFilters)
    replace(keys, guidance="flux2-klein").opened(CPU)
    assert opened == [(folders / "flux2-klein", "flux2-klein", CPU)]
