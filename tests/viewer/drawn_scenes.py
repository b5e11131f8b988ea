"""Scenes that pages draw: parts of models, volumes, and a series in time."""

from dataclasses import asdict, replace

import numpy as np
import torch
from torch.nn.functional import normalize

from tests.fields.surfels.test_composition import ball
from tests.scene.balls import ball_models
from tests.scene.test_twin import HIGH, LOOK, LOW
from texgs.core.io import write_json
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.step_file import write_step
from texgs.fields.surfels.variants import write_texture
from texgs.scene.scene import Scene, SceneModel, SceneSegment, SceneVolume
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.segment_file import write_segment
from texgs.scene.series_file import Series, write_series
from texgs.volume.generate import sphere
from texgs.volume.grid import Grid
from texgs.volume.label_masks import HALF, INSIDE, MaskSource
from texgs.volume.prepare import prepare, prepare_channels
from texgs.volume.slabs import ArraySource
from texgs.volume.space import UNKNOWN_SPACE
from texgs.volume.transfer import TransferFunction

COUNT, BEGIN = 5, 2  # steps of the series, and the one that its scene shows


def scene_of_parts(folder):
    """Two textured models, the first with two segments that overlap, and one without texture."""
    own = ball(1, n=400, shared=False)
    models = {"A": own, "B": ball(2, n=200, middle=0.2), "C": ball(3, n=60, stage="shading")}
    files = {name: write_model(folder / f"{name}.safetensors", model) for name, model in models.items()}
    above, right = own.parameters["means"][:, 1] > 0.1, own.parameters["means"][:, 0] > 0.2
    segments = {
        name: SceneSegment(write_segment(folder / f"{name}.segment", own, mask, {}), edit)
        for name, mask, edit in (
            ("above", above, PartEdit(palette=(0.1, 0.6, 0.2))),
            ("right", right, PartEdit(opacity=0.4, specular=3.0)),
        )
    }
    entries = {name: SceneModel(file) for name, file in files.items()}
    entries["A"] = SceneModel(files["A"], segments=segments)
    return Scene(entries)


def volume_of(folder, grid):
    """A prepared volume with two basic TFs, which are given on the range of its values."""
    write_json(folder / "volume.json", asdict(prepare(ArraySource(grid, "made"), folder / "volume.nrrd")))
    tfs = {"low": LOW.scaled(*ends_of(grid)), "high": HIGH.scaled(*ends_of(grid))}
    return SceneVolume(folder / "volume.nrrd", tfs, LOOK)


def ends_of(grid):
    return float(grid.values.min()), float(grid.values.max())


def waves(shape=(30, 26, 34), spacing=(1.0, 1.5, 0.7)):
    """A lumpy body on a lattice with different spacings."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, size) for size in shape), indexing="ij")
    values = np.exp(-2 * (x**2 + y**2 + z**2)) + 0.1 * np.sin(5 * x) * np.cos(4 * y) * np.cos(6 * z)
    return Grid(values.astype(np.float32), spacing, (3.0, -2.0, 10.0))


def scene_of_volume(folder, grid):
    """Two balls of surfels beside a volume that they have little to do with."""
    return Scene(ball_models(folder, "low", "high"), volume=volume_of(folder, grid))


def nested(shape=(44, 40, 48)):
    """Labels of three balls, 1 the outermost, one in the other, on a lattice with different spacings."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, size) for size in shape), indexing="ij")
    radius, labels = np.sqrt(x**2 + y**2 + z**2), np.zeros(shape, np.uint8)
    for number, most in enumerate((0.9, 0.6, 0.3), 1):
        labels[radius < most] = number
    return Grid(labels, (1.0, 1.2, 0.9), (3.0, -2.0, 10.0))


def image_on(grid, values):
    """An image of the bytes from 0 to 255 of values, on the lattice of a grid."""
    shares = (values - values.min()) / np.ptp(values)
    return replace(grid, values=(255 * shares).round().astype(np.uint8))


def scene_of_labels(folder, image=None, within=None, space=UNKNOWN_SPACE):
    """Balls of surfels with a mask each; an image beside them has a function, maybe within a mask."""
    source = ArraySource(replace(nested(), space=space), "balls")
    masks = [MaskSource(source, number) for number in (1, 2, 3)]
    sources = [*([ArraySource(replace(image, space=space), "image")] if image else []), *masks]
    prepare_channels(sources, folder / "volume.nrrd")
    looks, tfs = (((0.9, 0.6, 0.2), 0.03), ((0.2, 0.6, 0.9), 0.95), ((0.8, 0.2, 0.3), 0.95)), {}
    for number, (color, opacity) in enumerate(looks):
        points = ((HALF, opacity), (INSIDE, opacity))
        tfs[f"ball {number + 1}"] = TransferFunction(points, ((HALF, *color),), number + bool(image))
    if image:
        tfs["image"] = replace(LOW.scaled(*ends_of(image)), within=within)
    return Scene(ball_models(folder, *tfs), volume=SceneVolume(folder / "volume.nrrd", tfs, LOOK))


def at(model, time):
    """A model that moves to the right, turns, shrinks, fades and changes its colours."""
    p, g = dict(model.parameters), torch.Generator().manual_seed(time)
    p["means"] = p["means"] + p["means"].new_tensor([0.12 * time, 0, 0])
    for name in ("quats", "normals"):
        p[name] = normalize(p[name], dim=1) + 0.2 * time * torch.randn(p[name].shape, generator=g)
    p["scales"] = p["scales"] - 0.1 * time
    p["opacities"] = p["opacities"] + 0.5 * time
    p["colors"] = p["colors"] + 0.05 * time
    return replace(model, parameters=p)


def scene_of_series(folder):
    """Two models, of which one follows a series; a part of it has a look of its own, with its own colours."""
    key, other = ball(1, n=300), ball(2, n=60, middle=0.3)
    key.parameters["normals"] = key.parameters["quats"].flip(1)  # the other has none of its own
    styled = replace(key, parameters={**key.parameters, "colors": 0.5 * key.parameters["colors"] + 0.3})
    above = write_segment(folder / "above.segment", key, key.parameters["means"][:, 1] > 0.2, {})
    look = write_texture(folder / "look.safetensors", styled)
    series = Series(folder / "series.json", [f"{number}.nrrd" for number in range(COUNT)], ["A"])
    for time in range(COUNT):
        write_step(series.model("A", time), key, at(key, time), {})
        prepare(ArraySource(sphere(24 + 2 * time), "made"), series.volume(time))
    write_series(series)
    models = {
        "B": SceneModel(write_model(folder / "b.safetensors", other)),
        "A": SceneModel(
            write_model(folder / "a.safetensors", key), segments={"above": SceneSegment(above, texture=look)}
        ),
    }
    volume = SceneVolume(series.volume(0), {"A": LOW, "B": HIGH}, LOOK)
    whole = Scene(models, series=series, volume=volume).at(BEGIN)
    return read_scene(write_scene(folder / "scene.yaml", whole))
