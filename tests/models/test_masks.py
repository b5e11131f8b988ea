"""Mask models on pictures whose objects are known, and weights in the formats that they come in."""

from dataclasses import replace

import pytest
import torch

from tests.real_data import real_data
from tests.refusals import refused
from texgs.core.errors import ArgumentError, ShapeError
from texgs.models.masks import GrabCut, Remembered
from texgs.models.sam import Sam, best_of, published_sam, sam_folder

SIZE = 96


def picture(*discs, size=SIZE, background=(1.0, 1.0, 1.0)):
    """Shaded discs (x, y, radius, colour) on a plain background, and the mask of each."""
    at = torch.arange(size) + 0.5
    image, masks = torch.tensor(background).repeat(size, size, 1), []
    for x, y, radius, color in discs:
        distance = ((at[None] - x) ** 2 + (at[:, None] - y) ** 2).sqrt()
        masks.append(distance < radius)
        shade = (1.1 - 0.4 * distance / radius)[..., None]
        image = torch.where(masks[-1][..., None], shade * torch.tensor(color), image)
    return image.clamp(0, 1), masks


def overlap(mask, expected):
    return float((mask & expected).sum() / (mask | expected).sum())


def click(*points, negative=()):
    places = torch.tensor([*points, *negative], dtype=torch.float32)
    return places, torch.arange(len(places)) < len(points)


YELLOW, BLUE, RED = (0.9, 0.8, 0.1), (0.1, 0.2, 0.8), (0.8, 0.1, 0.1)


@pytest.mark.parametrize("size", [96, 700])
def test_grabcut_finds_the_object_clicked_on_among_others_of_its_colour(size):
    scale = size / 96
    discs = [(x * scale, y * scale, 15 * scale, YELLOW) for x, y in ((25, 30), (65, 30), (50, 70))]
    image, masks = picture(*discs, size=size)
    for (x, y, _, _), mask in zip(discs, masks, strict=True):
        assert overlap(GrabCut()(image, *click((x, y))), mask) > 0.93
    both = GrabCut()(image, *click(discs[0][:2], discs[2][:2]))
    assert overlap(both, masks[0] | masks[2]) > 0.93


def test_grabcut_tells_touching_objects_apart_by_colour_and_gives_the_same_mask_again():
    image, (yellow, blue) = picture((40, 48, 22, YELLOW), (62, 48, 18, BLUE))
    mask, again = (GrabCut()(image, *click((30, 48), negative=[(64, 48)])) for _ in range(2))
    assert torch.equal(mask, again)
    assert overlap(mask, yellow & ~blue) > 0.9
    assert overlap(GrabCut()(image, *click((64, 48), negative=[(30, 48)])), blue) > 0.9


def test_grabcut_finds_an_object_that_fills_a_picture_without_a_plain_border():
    generator = torch.Generator().manual_seed(0)
    image, (mask,) = picture((48, 48, 25, RED), background=(0.2, 0.6, 0.3))
    noisy = (image + 0.08 * torch.randn(image.shape, generator=generator)).clamp(0, 1)
    assert overlap(GrabCut()(noisy, *click((48, 48), (40, 40))), mask) > 0.9


NOWHERE = (torch.zeros(0, 2), torch.zeros(0, dtype=torch.bool))


def box(left, top, right, bottom):
    held = torch.zeros(SIZE, SIZE, dtype=torch.bool)
    held[top:bottom, left:right] = True
    return held


TOUCHING = ((40, 48, 22, YELLOW), (62, 48, 18, BLUE))
APART = ((25, 30, 15, YELLOW), (65, 30, 15, YELLOW), (50, 70, 15, YELLOW))
WITHIN = ((48, 48, 36, RED), (50, 46, 14, BLUE))


@pytest.mark.parametrize(
    ("discs", "held", "expected"),
    [
        (APART, box(5, 10, 55, 50), [0]),
        (APART, box(5, 10, 85, 50), [0, 1]),
        (TOUCHING, box(40, 28, 84, 68), [1]),
        (WITHIN, box(32, 28, 68, 64), [1]),
    ],
)
def test_grabcut_finds_what_an_outline_holds_and_not_what_touches_it(discs, held, expected):
    image, masks = picture(*discs)
    mask = GrabCut()(image, *NOWHERE, held)
    assert overlap(mask & held, torch.stack([masks[index] for index in expected]).any(0)) > 0.97


def test_clicks_refine_what_an_outline_holds():
    image, masks = picture(*APART)
    held = box(5, 10, 85, 50)
    assert overlap(GrabCut()(image, *click(negative=[(65, 30)]), held), masks[0]) > 0.97
    both = GrabCut()(image, *click((25, 30), (65, 30)), held)
    assert overlap(both, masks[0] | masks[1]) > 0.97
    image, (yellow, blue) = picture(*TOUCHING)
    mask = GrabCut()(image, *click((30, 48), negative=[(64, 48)]), held := box(10, 20, 90, 76))
    assert overlap(mask & held, yellow & ~blue) > 0.9


def test_a_part_of_what_looks_the_same_all_over_is_what_the_outline_holds_of_it():
    image, (disc,) = picture((48, 48, 36, RED))
    for held in (box(0, 0, 48, 96), box(36, 36, 60, 60)):
        assert overlap(GrabCut()(image, *NOWHERE, held), disc & held) > 0.97


@pytest.mark.parametrize(
    ("points", "positive", "error", "named"),
    [
        ([[3.0, 3.0]], [False], ArgumentError, "points: "),
        ([[96.0, 3.0]], [True], ArgumentError, r"96 x 96 pixels, got \(96, 3\)"),
        ([[3.0, 3.0]], [True, True], ShapeError, "positive: "),
        ([[float("nan"), 3.0]], [True], ArgumentError, "points: "),
    ],
)
def test_clicks_and_outlines_that_no_mask_model_takes(points, positive, error, named):
    image, _ = picture((48, 48, 20, RED))
    refused(lambda: GrabCut()(image, torch.tensor(points), torch.tensor(positive)), named, error)
    refused(lambda: GrabCut()(image, *NOWHERE, box(0, 0, 0, 0)), "outline: ")


def test_a_result_is_remembered_for_the_last_images():
    asked = []
    remembered = Remembered(lambda image: asked.append(float(image[0])) or image, most=2)
    for value in (1.0, 1.0, 2.0, 1.0, 3.0, 2.0):
        remembered(torch.tensor([value]))
    assert asked == [1, 2, 3, 2], "of 1, 2 and 3 the one not asked for longest was dropped"


def stub(best=1, size=32):
    """A SAM whose masks are squares of sides 4, 8 and 16 of 32 around the first point; `best` is its best."""
    asked = []

    def encode(pixels):
        asked.append(pixels)
        return pixels

    def decode(features, points, labels, box, several):
        at = torch.arange(size) * 1.0
        x, y = points[0, 0].tolist()
        near = torch.maximum((at[None] - x).abs(), (at[:, None] - y).abs())
        logits = torch.stack([side / 2 - near for side in (4.0, 8.0, 16.0)])
        count = 3 if several else 1
        return logits[:count], torch.eye(3)[best][:count]

    return Sam("stub", encode, decode, size), asked


@pytest.mark.parametrize("shape", [(32, 32), (64, 32), (32, 64), (24, 16)])
def test_masks_come_back_where_the_click_was(shape):
    sam, asked = stub()
    x, y = shape[1] * 0.4, shape[0] * 0.6
    mask = sam(torch.rand(*shape, 3), *click((x, y)))
    assert mask.shape == shape
    rows, columns = mask.nonzero().double().add(0.5).unbind(1)
    assert columns.mean() == pytest.approx(x, abs=0.06 * max(shape))
    assert rows.mean() == pytest.approx(y, abs=0.06 * max(shape))
    assert mask.sum() == pytest.approx((8 * max(shape) / 32) ** 2, rel=0.3)
    assert asked[0].shape == (1, 3, 32, 32)


def test_one_click_has_the_best_of_several_masks_and_more_clicks_have_one():
    image = torch.rand(32, 32, 3)
    sizes = [int(stub(best)[0](image, *click((16, 16))).sum()) for best in range(3)]
    assert sizes == sorted(sizes)
    assert sizes[0] < sizes[2]
    assert int(stub(2)[0](image, *click((16, 16), (17, 17))).sum()) == sizes[0]


def squares(*boxes):
    return torch.stack([box(*each) for each in boxes])


PART, WHOLE, AROUND = (30, 30, 50, 50), (20, 20, 70, 70), (0, 0, SIZE, SIZE)


@pytest.mark.parametrize(
    ("boxes", "quality", "shown", "best"),
    [
        ((PART, WHOLE, AROUND), (0.97, 1.01, 0.99), AROUND, 0),  # as good: the smallest
        ((PART, WHOLE, AROUND), (0.7, 1.01, 0.99), AROUND, 1),  # the smallest is much worse
        ((PART, WHOLE, AROUND), (0.4, 0.6, 1.0), WHOLE, 1),  # the best is mostly background
        (((60, 60, 80, 80), WHOLE, AROUND), (1.0, 0.7, 0.6), AROUND, 1),  # the click is not on the best
        ((PART, (0, 0, 0, 0), AROUND), (0.9, 1.0, 0.5), AROUND, 0),  # nothing is no object
    ],
)
def test_of_several_masks_the_smallest_good_one_that_holds_the_click_is_taken(boxes, quality, shown, best):
    masks, point = squares(*boxes), torch.tensor([[40, 40]])
    assert torch.equal(best_of(masks, torch.tensor(quality), point, box(*shown)), masks[best])


def test_an_image_is_encoded_once_for_all_clicks():
    sam, asked = stub()
    image = torch.rand(32, 32, 3)
    for x in (8, 16, 24):
        sam(image, *click((x, 16)))
        sam(image.clone(), *click((x, 16), (x, 17)))
    assert len(asked) == 1
    sam(torch.rand(32, 32, 3), *click((8, 16)))
    assert len(asked) == 2


@pytest.fixture(scope="module")
def tiny_sam(tmp_path_factory):
    """A folder with a random SAM of transformers, of images of 64x64."""
    transformers = pytest.importorskip("transformers")
    torch.manual_seed(0)
    vision = {"hidden_size": 16, "num_hidden_layers": 2, "num_attention_heads": 2, "image_size": 64}
    vision |= {"patch_size": 16, "output_channels": 32, "window_size": 2, "global_attn_indexes": [1]}
    vision |= {"mlp_dim": 32, "num_pos_feats": 16}
    prompt = {"hidden_size": 32, "image_size": 64, "patch_size": 16, "mask_input_channels": 4}
    decoder = {"hidden_size": 32, "mlp_dim": 32, "num_hidden_layers": 1, "num_attention_heads": 2}
    parts = {"vision_config": vision, "prompt_encoder_config": prompt}
    config = transformers.SamConfig(**parts, mask_decoder_config=decoder | {"iou_head_hidden_dim": 16})
    folder = tmp_path_factory.mktemp("weights") / "tiny-sam"
    transformers.SamModel(config).save_pretrained(folder)
    return folder


def test_a_sam_folder_agrees_with_the_pipeline_of_transformers(tiny_sam):
    from transformers import SamModel
    from transformers.models.sam.image_processing_pil_sam import SamImageProcessorPil

    image, _ = picture((20, 30, 12, RED), (44, 30, 12, BLUE), size=64)
    image = (image * 255).round() / 255
    points = torch.tensor([[20.0, 30.0], [30.0, 40.0]])
    processor = SamImageProcessorPil(size={"longest_edge": 64}, pad_size={"height": 64, "width": 64})
    pixels = processor((image * 255).byte().numpy(), return_tensors="pt")["pixel_values"]
    sam, network = sam_folder(tiny_sam, dtype=torch.float32), SamModel.from_pretrained(tiny_sam).eval()
    torch.testing.assert_close(sam.prepared(image), pixels.float(), atol=1e-5, rtol=1e-5)

    def theirs(**prompts):
        with torch.no_grad():
            masks = network(pixel_values=pixels.float(), multimask_output=False, **prompts).pred_masks[0]
        return torch.nn.functional.interpolate(masks, (64, 64), mode="bilinear")[0, 0] > 0

    clicked = theirs(input_points=points[None, None] - 0.5, input_labels=torch.tensor([[[1, 0]]]))
    assert torch.equal(sam(image, points, torch.tensor([True, False])), clicked)
    held = torch.zeros(64, 64, dtype=torch.bool)
    held[20:44, 6:34] = True
    boxed = theirs(input_boxes=torch.tensor([[[6.0, 20.0, 34.0, 44.0]]]) - 0.5)
    assert torch.equal(sam(image, *NOWHERE, held), boxed)


def test_what_holds_no_sam(tmp_path):
    (tmp_path / "clip").mkdir()
    (tmp_path / "clip" / "config.json").write_text('{"model_type": "clip"}')
    torch.save({"weight": torch.zeros(2)}, tmp_path / "other.pt")
    refused(lambda: sam_folder(tmp_path), r"config\.json: no such file")
    refused(lambda: sam_folder(tmp_path / "clip"), "type sam, got clip")
    refused(lambda: published_sam("mobile_sam", tmp_path / "none.pt"), r"none\.pt: no such file")
    refused(lambda: published_sam("mobile_sam", tmp_path / "other.pt"), r"other\.pt: .*MobileSAM")


def test_a_published_sam_of_another_size_gives_the_masks_of_kornia(tmp_path, monkeypatch):
    """With random weights, in the format of the published file, by an encoder of two layers."""
    from kornia.contrib.visual_prompter import VisualPrompter
    from kornia.models import sam as kornia

    torch.manual_seed(0)
    small = {"encoder_embed_dim": 16, "encoder_depth": 2, "encoder_num_heads": 2}
    small = kornia.SamConfig(**small, encoder_global_attn_indexes=(1,))
    torch.save(kornia.Sam.from_config(small).state_dict(), tmp_path / "random.pth")
    monkeypatch.setattr(kornia, "SamConfig", lambda kind: small)
    ours = published_sam("sam_vit_h", tmp_path / "random.pth", dtype=torch.float32)
    assert (ours.name, ours.size) == ("SAM ViT-H", 1024)
    prompter = VisualPrompter(replace(small, checkpoint=str(tmp_path / "random.pth")))
    image, _ = picture((30, 30, 16, YELLOW), (60, 40, 12, BLUE))
    prompter.set_image(image.permute(2, 0, 1))
    theirs = prompter.predict(torch.tensor([[(30.0, 30.0)]]) - 0.5, torch.ones(1, 1))
    expected = theirs.binary_masks[0, theirs.scores[0].argmax()]
    assert overlap(ours(image, *click((30.0, 30.0))), expected) > 0.99
    network = kornia.Sam.from_config(replace(small, checkpoint=str(tmp_path / "random.pth"))).eval()
    boxes = torch.tensor([[10.0, 12.0, 50.0, 44.0]]) * 1024 / 96 - 0.5
    with torch.no_grad():
        answer = network(ours.prepared(image), [{"boxes": boxes}], multimask_output=False)[0].logits
    logits = torch.nn.functional.interpolate(answer, (1024, 1024), mode="bilinear")
    expected = torch.nn.functional.interpolate(logits, (96, 96), mode="bilinear")[0, 0] > 0
    assert overlap(ours(image, *NOWHERE, box(10, 12, 50, 44)), expected) > 0.99


def test_mobile_sam_finds_the_disc_clicked_on():
    sam = published_sam("mobile_sam", real_data("weights/mobile_sam.pt"))
    image, masks = picture((30, 30, 16, YELLOW), (70, 40, 14, BLUE), (45, 74, 14, RED))
    for place, mask in zip(((30, 30), (70, 40), (45, 74)), masks, strict=True):
        assert overlap(sam(image, *click(place)), mask) > 0.9
    for (x, y, radius), mask in zip(((30, 30, 20), (70, 40, 18), (45, 74, 18)), masks, strict=True):
        held = box(x - radius, y - radius, x + radius, y + radius)
        assert overlap(sam(image, *NOWHERE, held) & held, mask) > 0.9
