"""Fits that a verb or a run cannot make are told in one sentence, before anything is written."""

import re
from dataclasses import replace

import pytest

from tests.refusals import refused
from texgs.cli.main import main
from texgs.core.errors import TexgsError
from texgs.fields.kinds import kinds
from texgs.workflow.plan import make


@pytest.fixture(autouse=True)
def empty(tmp_path, monkeypatch):
    """An empty folder, which stays so."""
    monkeypatch.chdir(tmp_path)
    yield
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ("texture fit=gaussians_quick", "fit.field: texgs texture fits surfels, .* gaussians"),
        ("gaussians fit=quick", "fit.field: .* surfels; run texgs texture"),
        ("comparison fit=quick", "fits: expected several recipes to compare"),
        ("comparison fits=[quick,plenoxels] device=cuda", "device: .* fit=plenoxels, which fits voxels"),
        ("compose fit=plenoxels device=cuda", "device: .* fit=plenoxels"),
        ("palette fit=stylerf_quick device=cuda", "device: .* fit=stylerf_quick, which fits palette"),
        ("surfels fit=paper fit.material_range=bounded", "fit.first_material.ambient: "),
        ("surfels fit=quick fit.texture.texels=0", "fit.texture.texels: "),
        ("page fit=stylerf", "fit.field: texgs page expects a fit of surfels, .* palette"),
        ("steps fit=gaussians", "fit.field: texgs steps expects a fit of surfels, .* gaussians"),
        ("steps fit=demo", "dataset.series of sphere: "),
        ("views dataset=vortex tf=TF01", "data set vortex: starts from views, it has no volume"),
    ],
)
def test_a_verb_wants_a_fit_and_a_data_set_that_it_can_work_on(capsys, words, named):
    verb, *rest = words.split()
    assert main([verb, "dataset=sphere", "dataset.volume.size=16", "tracking=none", *rest]) == 2
    assert re.search(named, capsys.readouterr().err.splitlines()[-1])


@pytest.mark.parametrize(
    ("keys", "named"),
    [
        (["fit.voxels.rays=1", "fit.voxels.run=2"], r"fit.voxels.run: expected at most rays \(1\), got 2"),
        (["fit.voxels.stages=[{side: 64}, {side: 100}]"], r"fit.voxels.stages: .* \[64, 100\]"),
        (["fit.voxels.stages=[]"], r"fit.voxels.stages: .* \[\]"),
        (["fit.voxels.step=100"], "fit.voxels.step: expected at most 8, got 100"),
        (["device=cuda"], "device: .* fit=plenoxels_quick"),
    ],
)
def test_what_does_not_fit_each_other_is_told_by_verbs_and_runs(capsys, keys, named):
    words = ["dataset=sphere", "fit=plenoxels_quick", *keys]
    assert main(["voxels", *words, "tracking=none"]) == 2
    assert re.search(named, capsys.readouterr().err.splitlines()[-1])
    refused(lambda: make(tuple(words)), named, TexgsError)


def test_a_mesh_wants_a_field_with_depth(monkeypatch, capsys):
    monkeypatch.setitem(kinds(), "voxels", replace(kinds()["voxels"], depth=""))
    assert main(["mesh", "fit=plenoxels_quick", "dataset=sphere", "tracking=none"]) == 2
    assert "fit.field: texgs mesh expects a fit of gaussians or palette or surfels" in capsys.readouterr().err
