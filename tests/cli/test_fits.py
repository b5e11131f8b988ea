"""Fits that a verb or a run cannot make are told in one sentence, before anything is written."""

import re
from dataclasses import replace

import pytest

from texgs.cli.main import main
from texgs.core.errors import ConfigError, TexgsError
from texgs.fields.kinds import kinds
from texgs.workflow.plan import make

ON_A_GPU = ("fit=plenoxels", "device=cuda")
CPU_ONLY = "device: expected cpu for fit=plenoxels, which fits voxels, got cuda"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["texture", "fit=gaussians_quick"],
            "fit.field: texgs texture fits surfels, but fit=gaussians_quick has field gaussians;",
        ),
        (
            ["gaussians", "fit=quick"],
            "fit.field: texgs gaussians fits gaussians, but fit=quick has field surfels; run texgs texture",
        ),
        (["comparison", "fit=quick"], "fits: expected several recipes to compare, such as fits=[quick,demo]"),
        (["comparison", "fits=[quick,plenoxels]", "device=cuda"], CPU_ONLY),
        (["voxels", *ON_A_GPU], CPU_ONLY),
        (
            ["surfels", "fit=paper", "fit.material_range=bounded"],
            "fit.first_material.ambient: expected a value between 0 and 1, as material_range=bounded has",
        ),
        (["surfels", "fit=quick", "fit.texture.texels=0"], "fit.texture.texels: expected"),
        (
            ["gaussians", "fit=gaussians_quick", "fit.gaussians.seeds.kind=voxels"],
            "fit.gaussians.seeds.kind: expected no voxels, which are for surfels alone; choose visible",
        ),
        (["compose", *ON_A_GPU], CPU_ONLY),
        (
            ["palette", "fit=stylerf_quick", "device=cuda"],
            "device: expected cpu for fit=stylerf_quick, which fits palette, got cuda",
        ),
    ],
)
def test_a_verb_wants_a_fit_that_it_can_work_on(tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    assert main([*words, "dataset=sphere", "dataset.volume.size=16", "tracking=none"]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (["rays=1", "run=2"], r"fit.voxels.run: expected at most rays \(1\), got 2"),
        (
            ["stages=[{side: 64}, {side: 100}]"],
            r"fit.voxels.stages: expected sides that double from one to the next, got \[64, 100\]",
        ),
        (["stages=[]"], r"fit.voxels.stages: expected sides that double from one to the next, got \[\]"),
        (["stages=[{side: 600}, {side: 1200}]"], r"fit.voxels.stages.*side: expected at most 1024, got 1200"),
        (["step=0.01"], r"fit.voxels.step: expected at least 0.1, got 0.01"),
        (["step=100"], r"fit.voxels.step: expected at most 8, got 100"),
    ],
)
def test_keys_of_voxels_that_do_not_fit_each_other(tmp_path, monkeypatch, capsys, keys, message):
    monkeypatch.chdir(tmp_path)
    words = ["dataset=sphere", "fit=plenoxels_quick", *(f"fit.voxels.{each}" for each in keys)]
    assert main(["voxels", *words, "tracking=none"]) == 2
    assert re.search(message, capsys.readouterr().err.splitlines()[-1])
    with pytest.raises(TexgsError, match=message):
        make(tuple(words))
    assert not list(tmp_path.iterdir())


def test_a_mesh_wants_a_field_with_depth(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(kinds(), "voxels", replace(kinds()["voxels"], depth=""))
    assert main(["mesh", "fit=plenoxels_quick", "dataset=sphere", "tracking=none"]) == 2
    said = capsys.readouterr().err
    assert (
        "fit.field: texgs mesh expects a fit of gaussians or palette or surfels, but fit=plenoxels_quick has"
        in said
    )
    assert not list(tmp_path.iterdir())


def test_a_run_wants_a_device_that_the_field_is_fitted_on(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match=CPU_ONLY):
        make(("dataset=sphere", *ON_A_GPU))
