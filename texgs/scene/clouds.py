"""A scene as clouds of splats for other programs: one colour per surfel, with light in its harmonics."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core.cuts import NO_CUTS
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.lens import Lens
from texgs.core.light import Light
from texgs.fields.field import Field
from texgs.fields.gaussians import Gaussians
from texgs.fields.part_edit import PartEdit, opacity_factors
from texgs.fields.splats import geometry
from texgs.fields.surfels.composition import EditableModel
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import FAR_DISTANCE
from texgs.fields.surfels.texels import with_single_texels
from texgs.raster.reference.shading import harmonics
from texgs.scene.exposure import exposure_of, require_shadows
from texgs.scene.scene import Scene
from texgs.scene.twin import twin_of
from texgs.volume.cameras import icosphere_of
from texgs.volume.space import Space

THICKNESS = 1e-6  # standard deviation of a surfel along its normal, world units
DIRECTIONS = 92  # of view, to sample the light on a surfel
COEFFICIENTS = {"headlight": 9, "directional": 16}  # a headlight looks the same from behind: even degrees


@dataclass(frozen=True)
class Cloud:
    """Splats of one model as rendered, all float32."""

    name: str
    is_flat: bool  # true for surfels, whose third axis is the normal
    antialiased: bool  # whether small ones stay faint, see texgs.raster.Options; surfels do
    means: np.ndarray  # [N, 3] world units, or units of the cloud's space
    quats: np.ndarray  # [N, 4] wxyz, unit length
    scales: np.ndarray  # [N, 3] standard deviations, world units
    opacities: np.ndarray  # [N] in [0, 1]
    sh: np.ndarray  # [N, K, 3] in the order and with the signs of 3DGS


def clouds_of(scene: Scene) -> list[Cloud]:
    """Return the visible splats of each model of surfels or 3D Gaussians, as edited and lit, but not cut.

    Raises:
        ArgumentError: if a model cannot be opened, nothing is visible, or there can be no shadows.
    """
    clouds, start, exposure, whole = [], 0, None, replace(scene, cuts=NO_CUTS)
    if scene.light.casts_shadows:
        require_shadows(scene)
        exposure = exposure_of(scene.open(), whole, twin_of(whole))
    for name, entry in scene.models.items():
        with errors_at(f"models.{name}"):
            opened = entry.open()
            own = None if exposure is None else exposure[start : start + len(opened[0])]
            clouds.append(cloud_of(name, opened, entry.edits, scene.light, own))
            start += len(opened[0])
    visible = [cloud for cloud in clouds if len(cloud.means)]
    if not visible:
        raise ArgumentError("models: expected at least one visible splat, got none; show a model")
    return visible


def place_cloud(cloud: Cloud, space: Space) -> Cloud:
    """Map a cloud from the world to a space with orthogonal axes.

    Gaussians look the same from behind, so a mirror image of one is a rotation of it.
    """
    turn = space.turn
    if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-3):
        raise ArgumentError("space: expected axes at right angles, got oblique ones; export to the world")
    rotation = Rotation.from_matrix(-turn if space.is_mirrored else turn)
    quats = (rotation * Rotation.from_quat(np.roll(cloud.quats, -1, axis=1))).as_quat()
    views, count = icosphere_of(DIRECTIONS, Lens(radius=FAR_DISTANCE)), cloud.sh.shape[1]
    ways = normalize(torch.stack([camera.position for camera in views]).double(), dim=1)
    before, after = (harmonics(x)[:, :count] for x in (ways, ways @ torch.from_numpy(turn.T)))
    moved = torch.linalg.lstsq(after, before).solution.numpy()  # [K, K]
    changed = {
        "means": space.points(cloud.means),
        "quats": np.roll(quats, 1, axis=1),
        "scales": space.scale * cloud.scales,
        "sh": np.einsum("kj,njc->nkc", moved, cloud.sh),
    }
    return replace(cloud, **{name: values.astype(np.float32) for name, values in changed.items()})


@torch.no_grad()
def cloud_of(
    name: str,
    opened: tuple[Field, Sequence[Tensor]],
    edits: Sequence[PartEdit],
    light: Light,
    exposure: Tensor | None = None,
) -> Cloud:
    """Return the visible cloud of a model from `SceneModel.open`.

    Edits are as in `EditableModel`, the exposure as in `Composition.under`.
    """
    model, masks = cast("Surfels | Gaussians", opened[0]), opened[1]
    means, quats, scales, opacities = geometry(model.parameters)
    is_flat = isinstance(model, Surfels)
    if isinstance(model, Surfels) and model.stage != "surfels":
        opacities, sh = light_harmonics(model, masks, edits, light, exposure)
    else:
        (factor,) = opacity_factors(edits, 1, model.kind)
        opacities, sh = (opacities * factor).clamp_max(1), model.parameters["sh"]
    if is_flat:
        scales = torch.cat([scales, torch.full_like(scales[:, :1], THICKNESS)], dim=1)
    values = (means, normalize(quats, dim=1), scales, opacities, sh)
    arrays = (value[opacities > 0].numpy() for value in values)
    return Cloud(name, is_flat, is_flat or model.shading.options.antialiased, *arrays)


def light_harmonics(
    model: Surfels,
    masks: Sequence[Tensor],
    edits: Sequence[PartEdit],
    light: Light,
    exposure: Tensor | None,
) -> tuple[Tensor, Tensor]:
    """Return opacities [N] and harmonics [N, K, 3] of edited surfels with one colour each, under a light.

    The colour is that of the mean texel under the Gaussian. Harmonics are the least squares of its looks from
    directions all around.
    """
    model = with_single_texels(model) if model.stage == "texture" else model
    texels = model.parameters.get("texels", torch.zeros_like(model.parameters["colors"]))
    part = EditableModel(model, masks)
    edited = part.apply(edits) if exposure is None else part.apply(edits).exposed(exposure)
    cameras = icosphere_of(DIRECTIONS, Lens(radius=FAR_DISTANCE))
    views = normalize(torch.stack([-camera.position for camera in cameras]).double(), dim=1)  # [M, 3]
    count = COEFFICIENTS[light.kind]
    solver = torch.linalg.pinv(harmonics(views)[:, :count]).float()  # [K, M]
    sh = texels.new_zeros(len(model), count, 3)
    for camera, weights in zip(cameras, solver.T, strict=True):
        base, gain = part.shade(edited, camera, light, "shaded")
        sh += weights[:, None] * (base + gain[:, None] * texels - 0.5)[:, None]
    return edited.opacities, sh
