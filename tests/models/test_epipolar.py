"""Epipolar lines against projected points, and attention across views against plain attention."""

import math

import pytest
import torch
from kornia.geometry.epipolar import essential_from_Rt, fundamental_from_essential
from torch.nn.functional import cosine_similarity
from torch.testing import assert_close

from tests.models.tiny_diffusion import save_tiny
from tests.refusals import refused
from texgs.core.camera import Camera, orbit
from texgs.models import epipolar
from texgs.models.epipolar import Consistency, epipolar_mask

PAIRS = [((0, 0), (40, 10)), ((0, 0), (180, 0)), ((-90, 0), (0, 90)), ((30, -60), (200, 45))]


def project(points, camera):
    """Pixels [P, 2] of points [P, 3], float64."""
    local = points @ camera.viewmat[:3, :3].double().T + camera.viewmat[:3, 3].double()
    pixels = local @ camera.K.double().T
    return pixels[:, :2] / pixels[:, 2:]


def points(count=300, seed=0):
    return (torch.rand(count, 3, generator=torch.Generator().manual_seed(seed)).double() - 0.5) * 0.9


def pair(angles, width=48, height=32):
    return (orbit(*each, 3.0, 35, width, height) for each in angles)


@pytest.mark.parametrize("angles", PAIRS)
def test_fundamental_matrix_of_kornia(angles):
    view, key = pair(angles)
    K, R, t = zip(*((c.K, c.viewmat[:3, :3], c.viewmat[:3, 3:]) for c in (view, key)), strict=True)
    expected = fundamental_from_essential(essential_from_Rt(R[0], t[0], R[1], t[1]), *K).T
    matrix = epipolar.fundamental(view, key).float()
    assert_close(matrix / matrix.norm(), expected / expected.norm(), atol=1e-5, rtol=0)


@pytest.mark.parametrize("angles", PAIRS)
def test_mask_allows_the_tokens_of_what_both_views_show(angles):
    view, key = pair(angles, 24, 16)
    places = [project(points(2000), camera).floor().long() for camera in (view, key)]
    inside = [((p >= 0) & (p < torch.tensor([24, 16]))).all(dim=1) for p in places]
    seen = inside[0] & inside[1]
    tokens = [p[:, 1] * 24 + p[:, 0] for p in places]
    allowed = epipolar_mask(view, key)
    share = allowed[tokens[0][seen], tokens[1][seen]].double().mean()
    assert share > 0.97  # half a token on either side of a line through a token's centre may be too far
    assert allowed.double().mean() < 0.35


def test_tokens_without_a_line_in_the_key_may_match_any():
    view = key = orbit(0, 0, 3.0, 60, 12, 12)
    assert epipolar_mask(view, key).all(), "of a camera with itself"
    viewmat = key.viewmat.clone()
    viewmat[0, 3] += 1.0  # a step aside: lines are rows of the image
    K = key.K.clone()
    K[1, 2] -= 6.25  # the lower half of the key, about
    allowed = epipolar_mask(view, Camera(viewmat, K, 12, 6))
    assert allowed.any(dim=1).all()
    assert allowed[:12].all()  # the first row is far above the key
    rows = allowed[8 * 12 + 3].reshape(6, 12)
    assert rows.any(dim=1).tolist() == [False, True, True, False, False, False]


def test_token_camera_keeps_pixels_in_their_tokens():
    camera = orbit(10, 20, 3.0, 40, 400, 300)
    tokens = epipolar.token_camera(camera, (384, 512), 48, 64)  # scaled to 512 x 384: a token is 8 pixels
    x = project(points(), camera) * (512 / 400) / 8
    assert_close(project(points(), tokens), x)


def test_match_is_brute_force():
    generator = torch.Generator().manual_seed(1)
    view, key = torch.randn(20, 6, generator=generator), torch.randn(15, 6, generator=generator)
    allowed = torch.rand(20, 15, generator=generator) < 0.3
    allowed[:, 4] |= ~allowed.any(dim=1)
    matches = epipolar.match(view, key, allowed)
    cosines = cosine_similarity(view.double()[:, None], key.double()[None], dim=2)
    assert torch.equal(matches, cosines.masked_fill(~allowed, -2).argmax(dim=1))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    pytest.importorskip("diffusers")
    return save_tiny(tmp_path_factory.mktemp("tiny") / "model")


@pytest.fixture
def unet(folder):
    from diffusers import UNet2DConditionModel

    return UNet2DConditionModel.from_pretrained(folder / "unet").eval().requires_grad_(False)


def inputs(count, same=False, seed=0):
    generator = torch.Generator().manual_seed(seed)
    latents = torch.randn(3, count, 8, 8, 8, generator=generator)
    if same:
        latents = latents[:, :1].expand(-1, count, -1, -1, -1).contiguous()
    return latents, torch.randn(3, 12, 16, generator=generator)


def branches_of(unet, latents, texts):
    def branches(ids):
        words = texts[:, None].expand(-1, len(ids), -1, -1).flatten(0, 1)
        return unet(latents[:, ids].flatten(0, 1), 500, words).sample.unflatten(0, (3, len(ids)))

    return branches


@pytest.mark.parametrize(("count", "keys"), [(2, 1), (10, 2)])
def test_of_equal_views_each_takes_over_what_it_would_have_had(unet, count, keys):
    """Of one camera and the same latents: attention is plain, and the outputs of two keys are blended."""
    latents, texts = inputs(count, same=True)
    branches = branches_of(unet, latents, texts)
    plain = branches([0])
    consistency = Consistency(unet)
    assert_close(branches([0]), plain, atol=1e-5, rtol=1e-5)  # by our attention for that of diffusers
    consistency.aim([orbit(0, 0, 3.0, 35, 64, 64)] * count, (64, 64))
    outputs = consistency.run(branches, count, 500, torch.Generator().manual_seed(0))
    assert len(consistency.key_ids) == keys
    assert_close(outputs, plain.expand_as(outputs), atol=1e-5, rtol=1e-5)


def test_other_views_take_over_from_the_key(unet):
    latents, texts = inputs(2)
    branches = branches_of(unet, latents, texts)
    consistency = Consistency(unet)
    consistency.aim(list(pair(((0, 0), (40, 10)), 64, 64)), (64, 64))
    alone = [branches([view])[:, 0] for view in range(2)]
    outputs = consistency.run(branches, 2, 500, torch.Generator().manual_seed(0))
    (key,) = consistency.key_ids
    assert_close(outputs[:, key], alone[key], atol=1e-5, rtol=1e-5)
    assert not torch.allclose(outputs[:, 1 - key], alone[1 - key], atol=1e-3)
    late = consistency.run(branches, 2, 50, torch.Generator().manual_seed(0))
    assert_close(late, torch.stack(alone, dim=1), atol=1e-5, rtol=1e-5)


def test_keys_attend_to_the_tokens_of_all_keys(unet):
    name = "down_blocks.0.attentions.0.transformer_blocks.0.attn1"
    attention = unet.get_submodule(name)
    consistency = Consistency(unet)
    consistency.role, consistency.key_ids = "key", [0, 1]
    hidden = torch.randn(6, 16, 32, generator=torch.Generator().manual_seed(2))
    output = attention(hidden).unflatten(0, (3, 2))
    views = hidden.unflatten(0, (3, 2))
    for branch in range(3):
        both = views[branch].flatten(0, 1)[None]
        exact = epipolar.attend(attention, both, both)[0].unflatten(0, (2, 16))
        assert_close(output[branch], exact, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize(("count", "keys"), [(1, 1), (6, 1), (10, 2), (20, 4), (23, 4)])
def test_one_view_of_each_group_is_a_key(count, keys):
    generator = torch.Generator().manual_seed(0)
    drawn = torch.tensor([epipolar.drawn_keys(count, generator) for _ in range(200)])
    assert drawn.shape == (200, keys)
    bounds = torch.linspace(0, count, keys + 1).round()
    assert (drawn >= bounds[:-1]).all()
    assert (drawn < bounds[1:]).all()
    assert len(drawn.unique()) == count, "any may be one"


def test_the_two_nearest_keys_share_by_their_distances(unet):
    consistency = Consistency(unet)
    consistency.aim([orbit(angle, 0, 3.0, 35, 64, 64) for angle in range(0, 100, 10)], (64, 64))
    consistency.key_ids = [0, 4, 9]
    (near, share), (far, rest) = consistency._nearest_keys(3)
    assert (near, far) == (1, 0)
    a, b = (6 * math.sin(math.radians(angle / 2)) for angle in (10, 30))  # chords
    assert share == pytest.approx(1 / (1 + math.exp(-b / (a + b))), abs=1e-5)
    assert share + rest == pytest.approx(1)
    consistency.key_ids = [5]
    assert consistency._nearest_keys(3) == [(0, 1.0)]


def test_a_network_without_self_attention_is_refused():
    network = torch.nn.Identity()
    network.attn_processors = {"mid.attn2.processor": None}
    refused(lambda: Consistency(network), "self-attention")
