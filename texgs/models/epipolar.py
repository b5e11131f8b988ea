"""Attention across views: views take features from key views along epipolar lines (DGE)."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import exp
from typing import Any

import torch
from torch import Tensor
from torch.nn.functional import normalize, scaled_dot_product_attention

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError

GROUP = 5  # consecutive views, one of them a key
LAST_TIMESTEP = 100  # timestep below which views get their own details
BAND = 1.0  # tokens: largest distance of a match from its epipolar line
BRANCH = 1  # the branch whose features are compared: with the image, without the instruction


def fundamental(view: Camera, key: Camera) -> Tensor:
    """Return F [3, 3], float64: a pixel x of the view is seen in the key on the line x^T F, homogeneous."""
    K_view, K_key = view.K.double().cpu(), key.K.double().cpu()
    relative = key.viewmat.double().cpu() @ torch.linalg.inv(view.viewmat.double().cpu())  # view to key
    x, y, z = relative[:3, 3].tolist()
    cross = torch.tensor([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=torch.float64)
    return (torch.linalg.inv(K_key).T @ cross @ relative[:3, :3] @ torch.linalg.inv(K_view)).T


def token_camera(camera: Camera, image: Sequence[int], rows: int, columns: int) -> Camera:
    """Return a camera whose pixels are the tokens of a view in an image of a height and width.

    The view fills the longer side of the image that the model works on.
    """
    scale = max(image) / max(camera.width, camera.height)
    K = camera.K.double().clone()
    K[0] *= scale * columns / image[1]
    K[1] *= scale * rows / image[0]
    return Camera(camera.viewmat.double(), K, columns, rows)


def epipolar_mask(view: Camera, key: Camera) -> Tensor:
    """Return which tokens of the key each token of the view may match [S, S'], bool, see `token_camera`.

    These lie within `BAND` of the epipolar line of the token's centre. All may match if none does, or if both
    cameras are at one place and there are no lines.
    """
    lines = _centers(view) @ fundamental(view, key)  # [S, 3]
    length = lines[:, :2].norm(dim=1, keepdim=True)
    distance = (lines @ _centers(key).T).abs() / length.clamp_min(1e-12)
    allowed = (distance <= BAND) | (length <= 1e-9)
    return allowed | ~allowed.any(dim=1, keepdim=True)


def _centers(camera: Camera) -> Tensor:
    """Return homogeneous pixel centres [S, 3], float64, row after row."""
    y, x = torch.meshgrid(
        torch.arange(camera.height, dtype=torch.float64) + 0.5,
        torch.arange(camera.width, dtype=torch.float64) + 0.5,
        indexing="ij",
    )
    return torch.stack([x, y, torch.ones_like(x)], dim=-1).reshape(-1, 3)


class Consistency:
    """Adds attention across views to a UNet of diffusers, for views that run together.

    In each denoising step a key view is drawn from each group of `GROUP` views that follow each other. Keys
    attend to the tokens of all keys; every other view takes over the attention outputs of the tokens of the
    two nearest keys that look most alike and lie on the epipolar line (Chen et al. 2024, section 4).
    Similarities are not masked by 0 but excluded. The self-attention that is replaced is of modules named
    attn1.
    """

    def __init__(self, unet: Any) -> None:
        processors = dict(unet.attn_processors)
        mine = {name: _SelfAttention(self) for name in processors if ".attn1." in name}
        if not mine:
            raise ArgumentError("epipolar: expected a UNet with self-attention, got none; turn epipolar off")
        unet.set_attn_processor({**processors, **mine})
        self.cameras: Sequence[Camera] = ()
        self.image: tuple[int, int] = (0, 0)
        self.role, self.view = "alone", 0
        self.nearest: list[tuple[int, float]] = []
        self.key_ids: list[int] = []
        self.masks: dict[tuple[int, int, int], Tensor] = {}
        self.stored: dict[int, tuple[Tensor, Tensor]] = {}

    def aim(self, cameras: Sequence[Camera], image: Sequence[int]) -> None:
        """Set the cameras of the views, and the model's height and width in pixels."""
        self.cameras, self.image = list(cameras), (image[0], image[1])
        self.masks = {}

    def run(
        self, branches: Callable[[list[int]], Tensor], count: int, time: int, generator: torch.Generator
    ) -> Tensor:
        """Return the noise [3, V, ...] of all views in one denoising step.

        `branches` runs the UNet on some views: [3, K, ...]. The generator draws the keys.
        """
        try:
            if time < LAST_TIMESTEP:
                self.role = "alone"
                return torch.cat([branches([index]) for index in range(count)], dim=1)
            self.key_ids, self.masks = drawn_keys(count, generator), {}  # all pairs would take gigabytes
            self.role, self.stored = "key", {}
            by_view = dict(zip(self.key_ids, branches(self.key_ids).unbind(dim=1), strict=True))
            self.role = "view"
            for index in range(count):
                if index not in by_view:
                    self.view, self.nearest = index, self._nearest_keys(index)
                    by_view[index] = branches([index])[:, 0]
            return torch.stack([by_view[index] for index in range(count)], dim=1)
        finally:
            self.role, self.stored = "alone", {}

    def mask(self, view: int, key: int, tokens: int) -> Tensor:
        """Return which of `count` tokens of a key may match those of a view."""
        if (view, key, tokens) not in self.masks:
            shrink = round((self.image[0] * self.image[1] / tokens) ** 0.5)
            rows, columns = self.image[0] // shrink, self.image[1] // shrink
            pair = (token_camera(self.cameras[i], self.image, rows, columns) for i in (view, key))
            self.masks[view, key, tokens] = epipolar_mask(*pair)
        return self.masks[view, key, tokens]

    def _nearest_keys(self, view: int) -> list[tuple[int, float]]:
        """Return places among the keys of the one or two whose cameras are nearest, and their shares."""
        position = self.cameras[view].position
        distances = torch.stack([(self.cameras[key].position - position).norm() for key in self.key_ids])
        order = distances.argsort(stable=True)[:2].tolist()
        if len(order) == 1:
            return [(order[0], 1.0)]
        near, far = distances[order].tolist()
        share = 1 / (1 + exp(-far / max(near + far, 1e-12)))  # of the nearer key, as in DGE: 0.62 to 0.73
        return [(order[0], share), (order[1], 1 - share)]


def drawn_keys(count: int, generator: torch.Generator) -> list[int]:
    """Return one of each group of so many views, drawn at random; groups are as equal as they can be."""
    bounds = torch.linspace(0, count, max(1, count // GROUP) + 1).round().long().tolist()
    return [int(torch.randint(low, high, (), generator=generator)) for low, high in pairwise(bounds)]


class _SelfAttention:
    """Processor of one self-attention module."""

    def __init__(self, consistency: Consistency) -> None:
        self.consistency = consistency

    def __call__(self, attn: Any, hidden_states: Tensor, *_: Any, **__: Any) -> Tensor:
        """Return the attention output of [B, S, C] features; B is 3 branches times views."""
        shared = self.consistency
        if shared.role == "alone":
            return attend(attn, hidden_states, hidden_states)
        if shared.role == "key":
            branches = hidden_states.unflatten(0, (3, len(shared.key_ids)))  # [3, K, S, C]
            everything = branches.flatten(1, 2).repeat_interleave(len(shared.key_ids), dim=0)
            output = attend(attn, hidden_states, everything)
            shared.stored[id(self)] = (branches[BRANCH], output.unflatten(0, (3, len(shared.key_ids))))
            return output
        features, outputs = shared.stored[id(self)]
        mixed = torch.zeros_like(hidden_states)
        for key, share in shared.nearest:
            allowed = shared.mask(shared.view, shared.key_ids[key], hidden_states.shape[1])
            mixed += share * outputs[:, key][:, match(hidden_states[BRANCH], features[key], allowed)]
        return mixed


def match(view: Tensor, key: Tensor, allowed: Tensor) -> Tensor:
    """Return the index [S] of the token of the key [S', C] most like each token of the view [S, C].

    By the cosine, of those that are allowed [S, S'], at least one in each row.
    """
    alike = normalize(view.float(), dim=1) @ normalize(key.float(), dim=1).T
    return alike.masked_fill(~allowed.to(alike.device), -torch.inf).argmax(dim=1)


def attend(attn: Any, queries: Tensor, keys: Tensor) -> Tensor:
    """Apply an attention module of diffusers to queries [B, S, C] and keys [B, S', C]."""
    q, k, v = (
        layer(x).unflatten(2, (attn.heads, -1)).transpose(1, 2)
        for layer, x in ((attn.to_q, queries), (attn.to_k, keys), (attn.to_v, keys))
    )
    mixed = scaled_dot_product_attention(q, k, v, scale=attn.scale).transpose(1, 2).flatten(2)
    return attn.to_out[1](attn.to_out[0](mixed)) / attn.rescale_output_factor
