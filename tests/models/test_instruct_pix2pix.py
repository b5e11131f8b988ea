"""InstructPix2Pix of random weights in the files of the real one: the loop around the network."""

import math
import sys
from itertools import pairwise

import pytest
import torch
from torch.testing import assert_close

from tests.models.tiny_diffusion import save_tiny
from tests.models.views_of import random_views
from tests.refusals import refused
from texgs.core.errors import MissingDataError
from texgs.models import instruct_pix2pix
from texgs.models.instruct_pix2pix import InstructPix2Pix, fit, unfit

pytest.importorskip("diffusers")
pytest.importorskip("transformers")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return save_tiny(tmp_path_factory.mktemp("weights") / "instruct-pix2pix")


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Work at 64 pixels instead of 512."""
    monkeypatch.setattr(instruct_pix2pix, "MAX_SIDE", 64)


def seeded(seed=0):
    return torch.Generator().manual_seed(seed)


def test_guidance_is_that_of_three_separate_calls(folder):
    model = InstructPix2Pix.open(folder, text_scale=12.5, image_scale=1.25)
    model.unet.double()
    generator = seeded()
    latents, kept = (torch.randn(2, 4, 8, 8, generator=generator).double() for _ in range(2))
    texts = torch.randn(3, 12, 16, generator=generator).double()
    texts[2] = texts[1]
    guided = model.predict(latents, kept, texts, 700, generator)
    for view in range(2):

        def e(condition, text, view=view):
            return model.unet(torch.cat([latents[view], condition])[None], 700, text[None]).sample[0]

        nothing, image = torch.zeros_like(kept[view]), kept[view]
        uncond = e(nothing, texts[1])
        exact = uncond + 1.25 * (e(image, texts[1]) - uncond)
        exact = exact + 12.5 * (e(image, texts[0]) - e(image, texts[1]))
        assert_close(guided[view], exact, atol=1e-9, rtol=1e-9)


def test_denoising_undoes_noise_that_is_predicted_exactly(folder):
    """With the true noise as the prediction, DDIM goes back along a straight line to the clean latents."""
    model = InstructPix2Pix.open(folder, steps=7)
    clean = torch.randn(1, 4, 8, 8, generator=seeded(1))
    noise = torch.randn(clean.shape, generator=seeded(2))  # what the loop will draw
    model.predict = lambda *_: noise
    denoised = model.denoise(clean, clean, torch.zeros(3, 1, 1), model.times(None), seeded(2))
    last = float(model.alphas[0])
    assert_close(denoised, math.sqrt(last) * clean + math.sqrt(1 - last) * noise, atol=1e-5, rtol=1e-4)


def test_steps_start_at_the_level_of_the_noise_of_stable_diffusion_and_end_at_none(folder):
    model = InstructPix2Pix.open(folder)
    betas = torch.linspace(0.00085**0.5, 0.012**0.5, 1000, dtype=torch.float64) ** 2
    assert_close(model.alphas, (1 - betas).cumprod(0), atol=1e-6, rtol=1e-5)
    for level, first in ((None, 998), (1.0, 999), (0.3, 300), (0.0, 20)):
        times = model.times(level)
        assert (times[0], times[-1], len(times)) == (first, 0, 21)
        assert all(a > b for a, b in pairwise(times))


@pytest.mark.parametrize("epipolar", [False, True])
def test_same_generator_same_images_of_any_size(folder, epipolar):
    model = InstructPix2Pix.open(folder, steps=2, epipolar=epipolar)
    views = random_views(3, height=20, width=33)
    first = model(views, "make it gold", seeded(4))
    assert first.shape == (3, 20, 33, 3)
    assert bool(((first >= 0) & (first <= 1)).all())
    assert torch.equal(first, model(views, "make it gold", seeded(4)))
    assert not torch.equal(first, model(views, "make it gold", seeded(5)))
    assert not torch.equal(first, model(views, "light", seeded(4)))
    other = InstructPix2Pix.open(folder, steps=2, epipolar=epipolar, negative="shadow")
    assert not torch.equal(first, other(views, "make it gold", seeded(4)))


def test_images_to_edit_are_scaled_latents_and_conditions_plain_ones(folder):
    model = InstructPix2Pix.open(folder)
    images = torch.rand(1, 3, 64, 64, generator=seeded())
    distribution = model.vae.encode(2 * images - 1).latent_dist
    assert_close(model.encode(images, None), distribution.mode())
    noise = torch.randn(distribution.mean.shape, generator=seeded(3))
    assert_close(model.encode(images, seeded(3)), 0.18215 * (distribution.mean + distribution.std * noise))


@pytest.mark.parametrize("size", [(48, 64), (64, 40), (30, 30), (100, 160), (7, 64)])
def test_resizing_there_and_back(size):
    y, x = torch.meshgrid(torch.linspace(0, 1, size[0]), torch.linspace(0, 1, size[1]), indexing="ij")
    images = torch.stack([x, y, 0.5 * x * y])[None]
    there = fit(images)
    assert not (torch.tensor(there.shape[2:]) % 64).any()
    assert max(there.shape[2:]) == 64
    back = unfit(there, size)
    assert back.shape == images.shape
    assert float((back - images).abs().mean()) < 0.01


def test_aspect_is_kept():
    """A square stays a square; the rest of the model's image is padding."""
    images = torch.ones(1, 3, 64, 128)
    images[:, :, 16:48, 32:64] = 0
    black = (fit(images)[0, 0] < 0.5).nonzero()
    assert (black.amax(dim=0) - black.amin(dim=0) + 1).tolist() == [16, 16]


def test_what_is_missing_or_another_model_is_named(folder, tmp_path, monkeypatch):
    path = save_tiny(tmp_path / "damaged") / "vae" / "diffusion_pytorch_model.safetensors"
    path.write_bytes(path.read_bytes()[:1000])
    for model, named in (
        (tmp_path / "damaged", "files of InstructPix2Pix"),
        (save_tiny(tmp_path / "plain", channels=4), "got 4 and 4"),
        (save_tiny(tmp_path / "v", prediction="v_prediction"), "v_prediction"),
    ):
        refused(lambda model=model: InstructPix2Pix.open(model), named)
    refused(lambda: InstructPix2Pix.open(tmp_path), "unet, vae, text_encoder", MissingDataError)
    refused(lambda: InstructPix2Pix.open(folder)(random_views(1), "  ", seeded()), "what to do in words")
    monkeypatch.setitem(sys.modules, "diffusers", None)
    refused(lambda: InstructPix2Pix.open(folder), "diffusers", MissingDataError)


def test_half_precision_keeps_the_loop_in_single(folder):
    """As on a GPU: networks in half precision, latents between steps in single."""
    model = InstructPix2Pix.open(folder, steps=3)
    single = model(random_views(1), "make it gold", seeded())
    for part in (model.unet, model.vae, model.text_encoder):
        part.half()
    seen = []
    predict = model.predict
    model.predict = lambda latents, *rest: seen.append(latents.dtype) or predict(latents, *rest)
    half = model(random_views(1), "make it gold", seeded())
    assert half.dtype == torch.float32
    assert set(seen) == {torch.float32}
    assert (half - single).abs().mean() < 0.01


@pytest.mark.parametrize("options", [{"steps": 0}, {"level": 1000}, {"steps": 30, "level": 20}])
def test_numbers_out_of_range(folder, options):
    refused(lambda: InstructPix2Pix.open(folder, **options), "1 <= steps <= level < 1000")
