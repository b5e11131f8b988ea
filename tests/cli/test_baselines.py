"""Baselines of the paper on small fits of their own fields, from the volume to the measures of the edit."""

import numpy as np
import pytest
import torch
from PIL import Image

from tests.cli.conftest import GAUSSIANS, SPHERE, numbers
from texgs.scene.scene_file import read_scene

pytestmark = pytest.mark.stages

VOXELS = [
    "fit=plenoxels_quick",
    "fit.voxels.stages=[{side: 16, steps: 30}, {side: 32, steps: 40}]",
    "fit.voxels.rays=512",
    "fit.voxels.degree=1",
]
PALETTE = [
    "fit=stylerf_quick",
    "fit.palette.voxels.stages=[{side: 16, steps: 40}]",
    "fit.palette.voxels.rays=512",
    "fit.palette.hash={levels: 3, entries: 1024, finest: 64}",
    "fit.palette.seed_steps=10",
    "fit.palette.base_steps=30",
    "fit.palette.palette_steps=20",
    "fit.palette.rays=512",
    "fit.palette.step=8",
    "fit.palette.colors=2",
]
PATCHES = ["nnfm=0", "patches=20"]
FILTERS = ["guidance=filters", "lpips=0", "instruction=turn it into gold"]
BASELINES = {  # fit and settings by edit
    "stylesplat": (GAUSSIANS, [*PATCHES, "iterations=4"]),
    "arf": (VOXELS, [*PATCHES, "epochs=0.2"]),
    "stylerf": (PALETTE, [*PATCHES, "epochs=0.2", "distillation=10", "styles=[strokes,glass]"]),
    "in2n_frozen": (VOXELS, [*FILTERS, "every=1", "passes=0.5"]),
    "igs2gs_frozen": (GAUSSIANS, [*FILTERS, "every=50", "passes=1"]),
    "dge": (GAUSSIANS, [*FILTERS, "every=4", "rounds=2", "views=3"]),
}


@pytest.fixture(scope="module", params=list(BASELINES))
def edited(request, at, gaussians):
    """The folder of an edit without weights, and its method; fits are shared."""
    edit, (fit, values) = request.param, BASELINES[request.param]
    method = edit.removesuffix("_frozen")
    words = [*SPHERE, *fit, f"edit={edit}", *(f"edit.{method}.{value}" for value in values)]
    results = at(gaussians.parent, [f"edit_{method}", *words], ["edit_metrics", *words])
    return results / "sphere" / "scene" / fit[0].removeprefix("fit=") / "edits" / edit, method


def test_geometry_is_kept_and_colours_are_not(edited):
    folder, method = edited
    before, after = (
        read_scene(path / "scene.yaml").models["TF01"].open()[0]
        for path in (folder.parents[1] / "compose", folder)
    )
    kept = [torch.equal(x, after.tensors("geometry")[n]) for n, x in before.tensors("geometry").items()]
    assert not any(kept) if method == "dge" else all(kept)
    one, two = (field.tensors("appearance") for field in (before, after))
    assert any(
        name not in one or one[name].shape != x.shape or not torch.equal(one[name], x)
        for name, x in two.items()
    )
    assert numbers(folder)["how"].startswith(("patches", "procedural filters, geometry "))
    assert numbers(folder)["method"] == method


def test_it_is_shown_and_measured(edited):
    folder, method = edited
    pictures = {"stylerf": ["style-TF01-1.png", "style-TF01-2.png"], "arf": ["style.png"]}.get(method, [])
    if method in ("in2n", "igs2gs", "dge"):
        pictures = ["views.png"]
    for name in (*pictures, "convergence.png", "edit.png"):
        assert np.asarray(Image.open(folder / name).convert("RGB")).std() > 5, f"{name} shows nothing"
    assert (folder / "turntable.mp4").stat().st_size > 1000
    measured = numbers(folder.parents[1] / "edit_metrics" / folder.name)
    assert measured["geometry_kept"] is (method != "dge")
    assert measured["frame_mean_ms"] > 0
