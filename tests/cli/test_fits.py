"""Fits that a verb or a run cannot make are told in one sentence, before anything is written."""

import re
from dataclasses import replace

import pytest

from texgs.cli.main import main
from texgs.core.errors import TexgsError
from texgs.fields.kinds import kinds
from texgs.workflow.plan import make

CPU_ONLY = "device: expected cpu for fit={}, which fits {}, got cuda"
PLENOXELS = CPU_ONLY.format("plenoxels", "voxels")
FITS = "fit.field: texgs {} fits {}, but fit={} has field {};"
AMBIENT = "fit.first_material.ambient: expected a value between 0 and 1, as material_range=bounded has"
ABLE = "fit.field: texgs {} expects a fit of {}, but fit={} has field {}; choose another fit"
OTHER = FITS.format("gaussians", "gaussians", "quick", "surfels") + " run texgs texture"
DOUBLING = "fit.voxels.stages: expected sides that double from one to the next, got"


@pytest.fixture(autouse=True)
def empty(tmp_path, monkeypatch):
    """An empty folder, which stays so."""
    monkeypatch.chdir(tmp_path)
    yield
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("texture fit=gaussians_quick", FITS.format("texture", "surfels", "gaussians_quick", "gaussians")),
        ("gaussians fit=quick", OTHER),
        ("comparison fit=quick", "fits: expected several recipes to compare, such as fits=[quick,demo]"),
        ("comparison fits=[quick,plenoxels] device=cuda", PLENOXELS),
        ("voxels fit=plenoxels device=cuda", PLENOXELS),
        ("compose fit=plenoxels device=cuda", PLENOXELS),
        ("palette fit=stylerf_quick device=cuda", CPU_ONLY.format("stylerf_quick", "palette")),
        ("surfels fit=paper fit.material_range=bounded", AMBIENT),
        ("surfels fit=quick fit.texture.texels=0", "fit.texture.texels: expected"),
        ("page fit=stylerf", ABLE.format("page", "surfels", "stylerf", "palette")),
        ("steps fit=gaussians", ABLE.format("steps", "surfels", "gaussians", "gaussians")),
        ("steps fit=demo", "dataset.series of sphere: expected the steps of a series in time, got none"),
    ],
)
def test_a_verb_wants_a_fit_that_it_can_work_on(capsys, words, message):
    assert main([*words.split(), "dataset=sphere", "dataset.volume.size=16", "tracking=none"]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize("verb", ["volume", "transfer", "views", "mesh"])
def test_a_verb_of_a_volume_wants_a_data_set_with_one(capsys, verb):
    assert main([verb, "dataset=vortex", "tf=TF01", "tracking=none"]) == 2
    assert "data set vortex: starts from views, it has no volume" in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (["fit.voxels.rays=1", "fit.voxels.run=2"], r"fit.voxels.run: expected at most rays \(1\), got 2"),
        (["fit.voxels.stages=[{side: 64}, {side: 100}]"], rf"{DOUBLING} \[64, 100\]"),
        (["fit.voxels.stages=[]"], rf"{DOUBLING} \[\]"),
        (["fit.voxels.stages=[{side: 600}, {side: 1200}]"], r"stages.*side: expected at most 1024, got 1200"),
        (["fit.voxels.step=0.01"], r"fit.voxels.step: expected at least 0.1, got 0.01"),
        (["fit.voxels.step=100"], r"fit.voxels.step: expected at most 8, got 100"),
        (["device=cuda"], CPU_ONLY.format("plenoxels_quick", "voxels")),
    ],
)
def test_what_does_not_fit_each_other_is_told_by_verbs_and_runs(capsys, keys, message):
    words = ["dataset=sphere", "fit=plenoxels_quick", *keys]
    assert main(["voxels", *words, "tracking=none"]) == 2
    assert re.search(message, capsys.readouterr().err.splitlines()[-1])
    with pytest.raises(TexgsError, match=message):
        make(tuple(words))


def test_a_mesh_wants_a_field_with_depth(monkeypatch, capsys):
    monkeypatch.setitem(kinds(), "voxels", replace(kinds()["voxels"], depth=""))
    assert main(["mesh", "fit=plenoxels_quick", "dataset=sphere", "tracking=none"]) == 2
    told = "texgs mesh expects a fit of gaussians or palette or surfels, but fit=plenoxels_quick has"
    assert f"fit.field: {told}" in capsys.readouterr().err
