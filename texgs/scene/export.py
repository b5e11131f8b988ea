"""Files of a scene or a model for other programs: splats, points or a mesh; or a compact model file."""

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np
import torch

from texgs.core.camera import Camera
from texgs.core.check import torch_device
from texgs.core.errors import ArgumentError
from texgs.core.lens import Frame
from texgs.fields import files
from texgs.fields.field import Field, Look
from texgs.fields.gaussians import Gaussians, JoinedGaussians
from texgs.fields.gaussians import write_ply as write_gaussians
from texgs.fields.kinds import Kind, kinds
from texgs.fields.part_edit import PartEdit
from texgs.fields.ply_columns import Told, colored_points, write_columns
from texgs.fields.splats import geometry
from texgs.fields.surfels.compact import seen_surfels, write_compact
from texgs.fields.surfels.composition import Composition, EditableModel
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.ply import write_ply as write_surfels
from texgs.raster.shading import Y00
from texgs.scene.bounds import bounds_of
from texgs.scene.clouds import clouds_of
from texgs.scene.clouds import place_cloud as placed_cloud
from texgs.scene.export_keys import CLOUD_KINDS, FILE_SPACE_KINDS, MESH_KINDS, Export
from texgs.scene.gltf import write_gltf
from texgs.scene.joined import join_surfels, write_vtp
from texgs.scene.mesh import depth_views, fuse, place_mesh, write_mesh
from texgs.scene.scene import Scene
from texgs.scene.spz import write_spz
from texgs.scene.textured import notes_on, textured
from texgs.scene.textured_files import write_glb, write_obj
from texgs.scene.usd import write_usd
from texgs.volume.cameras import icosphere_of, spiral
from texgs.volume.space import Space

TEST_VIEWS = 12  # that tell how far a textured mesh is from the scene
BAKED_NOTE = (
    "Surfels have one colour each, the mean of their texture, with the light of the scene as harmonics"
)


def write_export(path: Path, scene: Scene, keys: Export) -> list[str]:
    """Write a scene, or one model of it, into a file for other programs; return warnings for the user.

    Raises:
        ArgumentError, ShapeError: if it cannot be written so, or an option does not count.
    """
    kind, shown = keys.kind_of(path), single_model(scene, keys.model)
    require_other(path, scene)
    for entry in shown.models.values():
        require_export(files.kind_of(entry.file), kind)
    keys, notes = replace(keys, kind=kind), list[str]()
    if kind in MESH_KINDS:
        notes += export_surface(path, shown, keys)
    elif keys.model is not None and kind not in CLOUD_KINDS:
        export_model(path, shown.models[keys.model].open()[0], keys, shown.space)
    else:
        export_scene(path, shown, keys)
    if keys.model is not None and kind not in CLOUD_KINDS:
        return notes
    is_lost = kind in FILE_SPACE_KINDS and keys.space is None and shown.space is None
    lost = "in world units: the scene knows no space of a file; texgs compose writes it where there is one"
    notes += [BAKED_NOTE] * (kind in CLOUD_KINDS) + ["its cuts are left out"] * bool(shown.cuts)
    return notes + [lost] * is_lost


def single_model(scene: Scene, model: str | None) -> Scene:
    """Return the scene with only one of its models, edits included; None: the whole scene."""
    if model is None:
        return scene
    if model not in scene.models:
        raise ArgumentError(f"model: expected one of {', '.join(scene.models)}, got {model}")
    return replace(scene, models={model: scene.models[model]})


def views_of(keys: Export, frame: Frame) -> list[Camera]:
    """Return views of the whole frame."""
    placed = icosphere_of(keys.views, frame.lens().square(keys.size))
    return [camera.to(torch_device(keys.device)) for camera in placed]


def target_of(keys: Export, known: Space | None) -> Space | None:
    """Return the space of the exported positions, or None for the world.

    Args:
        keys: options.
        known: space of the volume's file, where the scene knows it.
    """
    if keys.space == "file" and known is None:
        raise ArgumentError(
            "space: expected a scene that knows the space of its volume's file, got none; export it to the "
            "world, or make it again by texgs compose"
        )
    is_moved = keys.kind in FILE_SPACE_KINDS if keys.space is None else keys.space == "file"
    return known if is_moved else None


def facts_of(keys: Export, known: Space | None) -> Told:
    """Return the facts that a file records about the scene's space."""
    if known is None:
        return None
    matrix = np.array(known.matrix, float).ravel().tolist()
    places = "space" if target_of(keys, known) else "world"
    return {"space": known.name, "unit": known.unit, "world_to_space": matrix, "places": places}


def require_export(field: Kind, kind: str) -> None:
    """Require that a kind of field supports an export."""
    if kind not in field.exports:
        able = " or ".join(name for name, other in kinds().items() if kind in other.exports)
        raise ArgumentError(
            f"--kind {kind}: expected {able}, got {field.name}, which can be exported as "
            f"{' or '.join(field.exports) or 'nothing'}"
        )


def require_other(path: Path, scene: Scene) -> None:
    """Refuse a path that the scene itself reads."""
    files = [file for model in scene.models.values() for file in model.files if file]
    if path.resolve() in [file.resolve() for file in files]:
        raise ArgumentError(f"{path}: expected a new file, got one that the scene reads; choose another")


def export_scene(path: Path, scene: Scene, keys: Export) -> Path:
    """Export the visible models of a scene as a single one."""
    space, facts = target_of(keys, scene.space), facts_of(keys, scene.space)
    if keys.kind in CLOUD_KINDS:
        clouds = [cloud if space is None else placed_cloud(cloud, space) for cloud in clouds_of(scene)]
        if keys.kind == "spz":
            return write_spz(path, clouds)
        return (write_usd if keys.kind == "usd" else write_gltf)(path, clouds, facts)
    composed, edits = scene.open(torch_device(keys.device)), scene.edits
    if isinstance(composed, JoinedGaussians):
        return write_gaussians(path, composed.with_edits(edits), facts)
    return _write(path, keys, join_surfels(cast(Composition, composed).parts, edits), scene.space)


def export_surface(path: Path, scene: Scene, keys: Export) -> list[str]:
    """Export the surface of a scene, or of its one model without edits, fused from views; return notes."""
    kind, device = files.kind_of(next(iter(scene.models.values())).file), torch_device(keys.device)
    has_light = "unlit" not in kind.can
    if keys.model is None:
        composed = scene.open(device)
        look: Look = "shaded" if has_light else "unshaded"
        frame, render = scene.framed(composed), partial(composed.render, edits=scene.edits, look=look)
    else:
        model = scene.models[keys.model].open()[0].to(device)
        frame, render = bounds_of([model]), partial(model.render)
        has_light = not isinstance(model, Surfels) or model.stage == "surfels"
        if isinstance(model, Surfels) and not has_light:
            render = partial(Composition([model]).render, look="unshaded")
    show = partial(render, outputs=(kind.depth,), background=torch.zeros(3, device=device))
    views, space, facts = views_of(keys, frame), target_of(keys, scene.space), facts_of(keys, scene.space)
    seen = depth_views(show, views)
    mesh = fuse(seen, keys.voxel)
    if keys.kind == "mesh":
        write_mesh(path, mesh if space is None else place_mesh(mesh, space), facts)
        return []
    baked = textured(mesh, seen, 3 * keys.voxel, keys.faces, keys.texture)
    placed = baked if space is None else baked.placed(space)
    if path.suffix == ".obj":
        write_obj(path, placed, facts)
    else:
        write_glb(path, placed, has_light=has_light, told=facts)
    around = spiral(TEST_VIEWS, frame.lens().square(keys.size))
    return notes_on(baked, show, [camera.to(device) for camera in around])


def export_model(path: Path, model: Field, keys: Export, known: Space | None = None) -> Path:
    """Export one model with everything the file format can hold."""
    model = model.to(torch_device(keys.device))
    if isinstance(model, Gaussians):
        return write_gaussians(path, model, facts_of(keys, known))
    return _write(path, keys, cast(Surfels, model), known)


def _write(path: Path, keys: Export, model: Surfels, known: Space | None) -> Path:
    """Write surfels directly, without rendering."""
    facts = facts_of(keys, known)
    if keys.kind == "compact":
        cameras = views_of(keys, bounds_of([model])) if keys.drop_unseen else []
        return write_compact(path, model, seen_surfels(model, cameras) if cameras else None)
    if keys.kind not in ("vtp", "points"):
        return write_surfels(path, model, str(keys.kind), facts)
    plain = join_surfels([EditableModel(model)], [PartEdit()]) if model.stage != "surfels" else model
    if keys.kind == "vtp":
        return write_vtp(path, plain, target_of(keys, known), facts)
    return _write_points(path, plain, keys, known)


def _write_points(path: Path, model: Surfels, keys: Export, known: Space | None) -> Path:
    """Write a PLY point cloud: means of surfels, and the colours of their constant harmonic, uint8."""
    means, _, _, opacities = geometry(model.parameters)
    opaque = opacities >= keys.opacity
    if not bool(opaque.any()):
        most = float(opacities.max()) if len(opacities) else 0.0
        raise ArgumentError(
            f"{path}: expected surfels with an opacity of {keys.opacity:g} at least, got {most:.3g} "
            "at most; lower the limit"
        )
    if not bool(opaque.all()):
        sys.stderr.write(
            f"{path}: {int(opaque.sum()):,} of {len(opaque):,} surfels, those with an opacity of "
            f"{keys.opacity:g} at least; --opacity 0 takes all\n"
        )
    color = (0.5 + Y00 * model.parameters["sh"][:, 0])[opaque]
    places, space = means[opaque], target_of(keys, known)
    if space is not None:
        places = torch.from_numpy(space.points(places.cpu().numpy()))
    return write_columns(
        path, colored_points(places, color.clamp(0, 1).mul(255).round()), told=facts_of(keys, known)
    )
