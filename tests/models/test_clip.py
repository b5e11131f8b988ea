"""CLIP's features, scores and losses against transformers' own pipeline and formulas written out."""

import numpy as np
import pytest
import torch
from torch.nn.functional import interpolate, normalize

from tests.models.clips import write_clip
from tests.refusals import refused
from texgs.core.errors import ShapeError
from texgs.edit.objective import ClipLoss
from texgs.models.clip import DEVIATION, MEAN, Clip, clip_scores, direction, similarity

TEXTS = ["a beetle", "a beetle made of gold"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_clip(tmp_path_factory.mktemp("weights") / "tiny-clip")


@pytest.fixture(scope="module")
def clip(folder):
    return Clip.load(folder)


def image(seed, height=32, width=32):
    """Smooth random colours, whole levels of 8 bits."""
    generator = torch.Generator().manual_seed(seed)
    coarse = torch.rand(1, 3, 4, 4, generator=generator)
    smooth = interpolate(coarse, (height, width), mode="bilinear")[0].permute(1, 2, 0)
    return (smooth * 255).round() / 255


def test_features_agree_with_the_pipeline_of_transformers(folder, clip):
    """Where nothing is resized, both preprocessings are the same."""
    from transformers import CLIPModel, CLIPTokenizer
    from transformers.models.clip.image_processing_pil_clip import CLIPImageProcessorPil

    model = CLIPModel.from_pretrained(folder).eval()
    processor = CLIPImageProcessorPil(size={"shortest_edge": 32}, crop_size={"height": 32, "width": 32})
    tokens = CLIPTokenizer.from_pretrained(folder)(TEXTS, padding=True, return_tensors="pt")
    pictures = [(image(seed).numpy() * 255).round().astype(np.uint8) for seed in (0, 1)]
    pixels = processor(pictures, return_tensors="pt")["pixel_values"].float()
    with torch.no_grad():
        outputs = model(pixel_values=pixels, **tokens)
    ours = clip.images(torch.stack([image(0), image(1)]))
    torch.testing.assert_close(ours, normalize(outputs.image_embeds, dim=1), atol=1e-5, rtol=0)
    texts = clip.texts(TEXTS)
    torch.testing.assert_close(texts, normalize(outputs.text_embeds, dim=1), atol=1e-5, rtol=0)
    logits = outputs.logits_per_image / model.logit_scale.exp()
    for text in range(2):
        torch.testing.assert_close(similarity(ours, texts[text]), logits[:, text], atol=1e-5, rtol=0)


def test_images_are_squeezed_bicubically_without_antialias_and_not_cropped(clip):
    wide = image(2, 20, 50)
    squeezed = interpolate(wide.double().permute(2, 0, 1)[None], (32, 32), mode="bicubic")[0]
    expected = (squeezed - torch.tensor(MEAN)[:, None, None]) / torch.tensor(DEVIATION)[:, None, None]
    torch.testing.assert_close(clip.prepared(wide[None])[0].double(), expected, atol=1e-5, rtol=0)


def test_features_are_differentiable_in_the_image(clip):
    picture = image(3, 40, 24).double().float().requires_grad_()
    loss = clip.images(picture[None])[0, 0]
    (gradient,) = torch.autograd.grad(loss, picture)
    step = 1e-2 * torch.randn(picture.shape, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        change = (clip.images(picture[None] + step) - clip.images(picture[None] - step))[0, 0] / 2
    assert float(change) == pytest.approx(float((gradient * step).sum()), rel=0.02)


def test_scores_are_means_of_cosines_over_views(clip):
    before, after = [image(0), image(1, 24, 40)], [image(5), image(6, 24, 40)]
    mean_similarity, mean_direction = clip_scores(clip, after, before, *TEXTS)
    f = [clip.images(x[None])[0].double() for x in (*before, *after)]
    g = clip.texts(TEXTS).double()

    def cosine(a, b):
        return float(a @ b / (a @ a).sqrt() / (b @ b).sqrt())

    assert clip.name == "tiny-clip"
    assert mean_similarity == pytest.approx(np.mean([cosine(f[2], g[1]), cosine(f[3], g[1])]), abs=1e-5)
    expected = [cosine(f[2] - f[0], g[1] - g[0]), cosine(f[3] - f[1], g[1] - g[0])]
    assert mean_direction == pytest.approx(np.mean(expected), abs=1e-4)


def test_directions_in_closed_form():
    source, target = torch.tensor([1.0, 0.0, 0.0]), torch.tensor([0.0, 1.0, 0.0])
    as_said, against = target[None], 2 * source[None] - target[None]
    assert direction(source[None], as_said, source, target).item() == pytest.approx(1)
    assert direction(source[None], against, source, target).item() == pytest.approx(-1)
    assert direction(source[None], source[None], source, target).item() == 0, "nothing was edited"


def test_scores_that_cannot_be_computed(clip):
    refused(lambda: clip_scores(clip, [image(0)], [image(0)] * 2, *TEXTS), "got 1 and 2")
    refused(lambda: clip_scores(clip, [], [], *TEXTS), "got 0 and 0")
    refused(lambda: clip_scores(clip, [image(0)], [image(0)], " ", "a beetle"), "texts: ")
    refused(lambda: similarity(torch.ones(2, 24), torch.ones(12)), "text: ", ShapeError)


def test_long_texts_are_cut_off(clip):
    long = "a beetle " * 30
    assert torch.equal(clip.texts([long]), clip.texts([long + "made of stone"]))
    assert not torch.allclose(clip.texts(["a beetle"]), clip.texts(["a beetle made of stone"]))


def test_the_loss_is_the_distance_of_features_of_whole_images_and_falls_along_its_gradient(clip):
    style, picture = image(7, 40, 30), image(8, 48, 40).requires_grad_()
    loss = ClipLoss(clip, style)
    assert loss(style) == pytest.approx(0, abs=1e-5)
    assert loss(style.clone().requires_grad_()).isfinite()
    before = loss(picture)
    expected = (clip.images(picture[None]) - clip.images(style[None])).norm()
    assert float(before.detach()) == pytest.approx(float(expected.detach()), rel=1e-5)
    (gradient,) = torch.autograd.grad(before, picture)
    assert gradient.isfinite().all()
    assert loss(picture.detach() - 0.5 * gradient / gradient.norm()) < before


def test_weights_that_are_of_another_model_or_damaged(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("TEXGS_WEIGHTS", str(tmp_path / "none"))
    refused(lambda: Clip.load("clip"), "weights: .*clip-vit-base-.*'clip'")
    (tmp_path / "config.json").write_text('{"model_type": "siglip"}')
    refused(lambda: Clip.load(tmp_path), "type clip, got siglip")
    (tmp_path / "config.json").write_text((folder / "config.json").read_text())
    (tmp_path / "model.safetensors").write_bytes((folder / "model.safetensors").read_bytes()[:99])
    refused(lambda: Clip.load(tmp_path), "clip model of transformers")
