"""Baselines of the paper on small fits of their own fields, from the volume to the measures of the edit."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from tests.cli.test_fit_gaussians import TINY
from texgs.cli.main import main
from texgs.scene.scene_file import read_scene

COMMON = [word for word in TINY if not word.startswith(("fit=", "fit."))]
GAUSSIANS = [word for word in TINY if word.startswith(("fit=", "fit."))]
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
def edited(request, tmp_path_factory):
    """The folder of an edit without weights, and its method."""
    edit, (fit, values) = request.param, BASELINES[request.param]
    method = edit.removesuffix("_frozen")
    words = [*COMMON, *fit, f"edit={edit}", *(f"edit.{method}.{value}" for value in values)]
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp(method)
        patch.chdir(folder)
        patch.setenv("TEXGS_WEIGHTS", str(folder / "none"))
        patch.setenv("TORCH_HOME", str(folder / "none"))
        patch.setattr("texgs.report.before_after.TURN", 4)  # frames of palette fields take long
        assert main([f"edit_{method}", *words]) == 0
        assert main(["edit_metrics", *words]) == 0
        (scene,) = Path("results/sphere/scene").iterdir()
        yield folder / scene / "edits" / edit, method


def numbers(folder):
    return json.loads((folder / "metrics.json").read_text())["numbers"]


@pytest.mark.stages
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


@pytest.mark.stages
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


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["edit_arf", "fit=quick", "edit=arf"], "edit arf: expected a fit of voxels, got one of surfels"),
        (
            ["edit_stylesplat", "fit=plenoxels_quick", "edit=stylesplat"],
            "edit stylesplat: expected a fit of gaussians, got one of voxels",
        ),
        (
            ["edit_arf", "fit=plenoxels_quick", "edit=arf", "edit.arf.nnfm=0"],
            "edit.arf.nnfm, edit.arf.patches: expected a weight above 0 for one of them, got 0 for both",
        ),
        (
            ["edit_stylerf", "fit=quick", "edit=stylerf"],
            "edit stylerf: expected a fit of palette, got one of surfels",
        ),
        (
            ["edit_stylerf", "fit=stylerf_quick", "edit=stylerf", "edit.stylerf.styles=[dots,none.png]"],
            "edit.stylerf.styles: expected the file of a picture, or one of strokes",
        ),
        (
            ["edit_stylerf", "fit=stylerf_quick", "edit=stylerf", "edit.stylerf.styles=[dots,glass]"],
            "edit.stylerf.styles: expected one for each of 1 palette colours of fit=stylerf_quick, got 2; or",
        ),
        (
            ["edit_arf", "fit=plenoxels_quick", "edit=arf", "edit.arf.style=none.png"],
            "edit.arf.style: expected the file of a picture, or one of strokes",
        ),
        (["edit_dge", "fit=quick", "edit=dge"], "edit dge: expected a fit of gaussians, got one of surfels"),
        (
            ["edit_dge", "fit=gaussians_quick", "edit=dge_quick", "edit.dge.instruction=make it odd"],
            "instruction: expected",
        ),
        (
            ["edit_in2n", "fit=plenoxels_quick", "edit=in2n_quick", "edit.in2n.noise=[0.9,0.1]"],
            "edit.in2n.noise: expected two shares from 0 to 1, the smaller one first, got [0.9, 0.1]",
        ),
        (
            [
                "edit_igs2gs",
                "fit=gaussians_quick",
                "edit=igs2gs_quick",
                "edit.igs2gs.l1=0",
                "edit.igs2gs.dssim=0",
            ],
            "edit.igs2gs.l1, dssim, lpips: expected a weight above 0 for one of them, got 0 for all",
        ),
        (
            ["edit_igs2gs", "fit=gaussians_quick", "edit=igs2gs_quick", "edit.looks=true"],
            "dataset.looks of sphere: expected a look for each of TF01, got none for TF01; add one",
        ),
        (
            ["edit_segment", "fit=quick", "edit=lobe", "edit.segment.model=TF01", "edit.looks=true"],
            "edit.looks: expected a method that follows a picture or an instruction, got segment",
        ),
    ],
)
def test_what_cannot_be_is_one_sentence(tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    assert main([*words, "dataset=sphere", "tracking=none"]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]
    assert not list(tmp_path.iterdir())
