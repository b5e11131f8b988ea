"""Editors that take each view alone: tiny pipelines of diffusers in their real files, and a local server."""

import json
import sys
import time
from base64 import b64decode, b64encode
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
import torch
from PIL import Image
from torch.testing import assert_close

from tests.models.servers import replies, served
from tests.models.tiny_pipelines import save_klein, save_sdxl
from tests.models.views_of import random_views
from tests.refusals import refused
from tests.toys.editor import Editor
from texgs.models import editors
from texgs.models.editors import Endpoint, ImagePipeline
from texgs.models.instruct_pix2pix import NO_LIGHT

CPU = torch.device("cpu")


def seeded(seed=0):
    return torch.Generator().manual_seed(seed)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Folders with tiny pipelines, by name."""
    pytest.importorskip("diffusers")
    pytest.importorskip("transformers")
    folder = tmp_path_factory.mktemp("pipelines")
    return {
        "sdxl": save_sdxl(folder / "sdxl"),
        "klein": save_klein(folder / "klein"),
        "turbo": save_sdxl(folder / "turbo", "StableDiffusionXLPipeline"),
    }


@pytest.fixture(scope="module")
def pipelines(folders):
    """Editors, opened once, by name; the one of words alone became one of images."""
    return {name: ImagePipeline.open(folder, name, CPU, steps=4) for name, folder in folders.items()}


CLASSES = {
    "sdxl": "StableDiffusionXLInstructPix2PixPipeline",
    "klein": "Flux2KleinPipeline",
    "turbo": "StableDiffusionXLImg2ImgPipeline",
}


@pytest.mark.parametrize("name", CLASSES)
def test_the_same_seed_gives_the_same_images_of_the_size_of_the_views(pipelines, name):
    editor, views = pipelines[name], random_views(2, height=70, width=100)
    assert type(editor.pipeline).__name__ == CLASSES[name]
    first = editor(views, "make it gold", seeded(4))
    assert first.shape == views.images.shape
    assert bool(first.isfinite().all())
    assert torch.equal(first, editor(views, "make it gold", seeded(4)))
    assert not torch.equal(first, editor(views, "make it gold", seeded(5)))
    assert not torch.equal(first, editor(views, "light", seeded(4)))


def test_qwen_image_edit_is_asked_by_its_own_name_of_the_scale():
    qwen = type("Qwen", (), {"__call__": pytest.importorskip("diffusers").QwenImageEditPipeline.__call__})
    editor = ImagePipeline(qwen(), "qwen", steps=2, text_scale=3.0)
    assert editor.options == {"num_inference_steps": 2, "true_cfg_scale": 3.0, "negative_prompt": NO_LIGHT}


class Recording:
    """A pipeline that takes what InstructPix2Pix does, returns its image and keeps what it is told."""

    def __init__(self, made=np.asarray):
        self.made, self.seen = made, []

    def __call__(
        self, image, prompt, negative_prompt="", num_inference_steps=1, guidance_scale=1.0,
        image_guidance_scale=1.0, generator=None, output_type="pil", strength=0.5, height=None, width=None,
    ):  # fmt: skip
        self.seen.append(locals())
        return type("Output", (), {"images": [self.made(image) / 255]})


def test_a_pipeline_gets_all_that_it_takes():
    recording = Recording()
    options = {"steps": 7, "text_scale": 3.0, "image_scale": 1.5, "negative": "fog"}
    editor, views = ImagePipeline(recording, "x", size=128, **options), random_views(2, height=50, width=100)
    editor(replace(views, level=0.75), " make it gold ", seeded())
    first, second = recording.seen
    assert {name: first[name] for name in first if name not in ("self", "image", "generator")} == {
        **{"prompt": "make it gold", "negative_prompt": "fog", "num_inference_steps": 7},
        **{"guidance_scale": 3.0, "image_guidance_scale": 1.5, "output_type": "np"},
        **{"strength": 0.75, "height": 64, "width": 128},
    }
    assert first["image"].size == (128, 64)
    assert first["generator"].initial_seed() == second["generator"].initial_seed()
    editor = ImagePipeline(recording, "x")
    editor(views, "make it gold", seeded())
    assert recording.seen[-1]["strength"] == 0.5, "its own, without a level"
    assert recording.seen[-1]["negative_prompt"] == NO_LIGHT
    assert recording.seen[-1]["image"].size == (96, 48), "multiples of 16"


@pytest.mark.parametrize("shrink", [1, 2])
def test_what_comes_back_lies_where_it_lay_at_the_size_of_the_view(shrink):
    """A ramp stays a ramp, up to 8 bits and the edge, also where a pipeline returns another size."""
    y, x = torch.meshgrid(torch.linspace(0, 1, 50), torch.linspace(0, 1, 70), indexing="ij")
    views = random_views(1, height=50, width=70)
    views = replace(views, images=torch.stack([x, y, 0.5 * x], dim=-1)[None])

    def made(image):
        return np.asarray(image.resize((image.width // shrink, image.height // shrink), Image.Resampling.BOX))

    edited = ImagePipeline(Recording(made), "x")(views, "make it gold", seeded())
    assert_close(edited[:, 4:-4, 4:-4], views.images[:, 4:-4, 4:-4], atol=0.006, rtol=0)


@pytest.mark.parametrize(
    ("name", "key", "value", "argument"),
    [("turbo", "image_scale", 1.0, "image_guidance_scale"), ("klein", "negative", "fog", "negative_prompt")],
)
def test_what_a_pipeline_cannot_take_is_said(pipelines, name, key, value, argument):
    refused(lambda: ImagePipeline(pipelines[name].pipeline, name, **{key: value}), f"{key}: .* no {argument}")


def test_folders_that_hold_no_such_pipeline_are_refused(folders, tmp_path, monkeypatch):
    refused(lambda: ImagePipeline.open(tmp_path, "x", CPU), "no file named model_index")
    (tmp_path / "model_index.json").write_text('{"_class_name": "NoSuchPipeline"}')
    refused(lambda: ImagePipeline.open(tmp_path, "x", CPU), "NoSuchPipeline")
    monkeypatch.setitem(sys.modules, "diffusers", None)
    refused(lambda: ImagePipeline.open(folders["sdxl"], "x", CPU), r"pip install '\.\[models\]'")


def test_what_a_pipeline_trips_over_names_it(pipelines):
    views = random_views(1)
    nothing, broken = replace(views, level=0.0), ImagePipeline(Recording(lambda image: np.zeros(3)), "x")
    refused(lambda: pipelines["turbo"](nothing, "make it gold", seeded()), "edited view of turbo")
    refused(lambda: broken(views, "make it gold", seeded()), "edited view of x")
    refused(lambda: pipelines["sdxl"](views, "  ", seeded()), "what to do in words")


def test_the_server_of_the_documentation_edits_views(capfd):
    views = random_views(2, height=24, width=32)
    with served(Editor) as address:
        edited = Endpoint(address, {})(views, "invert it", seeded())
    assert_close(edited, 1 - views.images, atol=0.5 / 255 + 1e-6, rtol=0)


def test_a_server_is_asked_once_for_each_view_with_what_is_given():
    seen = []

    def reply(body):
        seen.append(json.loads(body))
        return 200, "OK", json.dumps({"image": seen[-1]["image"]}).encode()

    views = random_views(2)
    options = {"steps": 4, "text_scale": 2.0, "negative": ""}
    with served(replies(reply)) as address:
        edited = Endpoint(address, options)(replace(views, level=0.5), "make it gold", seeded(3))
        Endpoint(address, {})(views, "make it gold", seeded(3))
    assert_close(edited, views.images, atol=0.5 / 255 + 1e-6, rtol=0)
    assert len(seen) == 4
    with Image.open(BytesIO(b64decode(seen[1].pop("image")))) as picture:
        pixels = torch.tensor(np.asarray(picture)).float() / 255
    assert_close(pixels, views.images[1], atol=0.5 / 255 + 1e-6, rtol=0)
    seed = seen[0]["seed"]
    assert seen[1] == {"instruction": "make it gold", "level": 0.5, "seed": seed, **options}
    assert set(seen[2]) == {"image", "instruction", "seed"}
    assert seen[2]["seed"] == seed, "of the generator alone"


def png(size=(32, 24), mode="RGB"):
    Image.new(mode, size).save(file := BytesIO(), "PNG")
    return b64encode(file.getvalue()).decode()


@pytest.mark.parametrize(
    ("status", "body", "named"),
    [
        (500, b"", "HTTP Error 500: why"),
        (503, b"out of memory", "HTTP Error 503: why, out of memory"),
        (200, b'{"error": "out of memory"}', "out of memory"),
        (200, b"<html>", "line 1 column 1"),
        (200, b'{"image": 3}', "bytes-like"),
        (200, b'{"image": "aaaa"}', "cannot identify"),
        (200, json.dumps({"image": png()[:60]}).encode(), ""),
        (200, json.dumps({"image": png((16, 24))}).encode(), "RGB of 16 x 24 for RGB of 32 x 24"),
        (200, json.dumps({"image": png(mode="RGBA")}).encode(), "RGBA of 32 x 24 for RGB"),
    ],
)
def test_what_a_server_does_wrong_is_told_and_nothing_is_tried_again(status, body, named):
    count = []
    with served(replies(lambda _: count.append(1) or (status, "why", body))) as address:
        refused(
            lambda: Endpoint(address, {})(random_views(1), "make it gold", seeded()), f"{address}: .*{named}"
        )
    assert len(count) == 1


def test_no_server_and_a_silent_one_are_told(monkeypatch):
    with served(Editor) as address:
        pass  # it is gone afterwards
    refused(lambda: Endpoint(address, {})(random_views(1), "make it gold", seeded()), "Connection refused")
    monkeypatch.setattr(editors, "TIMEOUT", 0.1)
    with served(replies(lambda body: time.sleep(0.5) or (200, "OK", b""))) as address:
        refused(lambda: Endpoint(address, {})(random_views(1), "make it gold", seeded()), "timed out")
