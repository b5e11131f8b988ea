"""Mistakes in an edit's configuration, told without its scene and without weights."""

import pytest

from texgs.config.compose import compose
from texgs.core.errors import ArgumentError, ConfigError, MissingDataError
from texgs.workflow.checks import check_edit, require_edit
from texgs.workflow.stage_table import STAGES

FITS = {
    **dict.fromkeys(("arf", "in2n"), "plenoxels_quick"),
    **dict.fromkeys(("stylesplat", "igs2gs", "dge"), "gaussians_quick"),
    "stylerf": "stylerf_quick",
}


@pytest.mark.parametrize("edit", ["none", "style", "glass", "text", "gold", "crimson", "lobe"])
def test_edits_of_the_project_have_none(edit):
    check_edit(compose((f"edit={edit}",)))


@pytest.mark.parametrize(
    ("edit", "word", "message"),
    [
        ("style", "edit.image.style=nowhere.png", "one of strokes, glass, .*; got 'nowhere.png'"),
        ("glass", "edit.image.region=[[2, 0]]", "edit.image.region: expected two shares from 0 to below 1"),
        ("text", "edit.text.instruction=", "instruction: expected what to do in words"),
        ("gold", "edit.text.instruction=fur", "which needs guidance=instruct_pix2pix"),
        ("gold", "edit.text.instruction='make it sing'", "expected one of stipple drawing, "),
        ("lobe", "edit.segment.name=", "edit.segment.name: expected a name without / . ="),
        ("lobe", "edit.segment.points=[]", "edit.segment.points: expected one at least"),
        ("lobe", "edit.segment.points=[[2, 0]]", "edit.segment.points: expected two shares from 0 to below"),
        ("lobe", "edit.segment.view=[3]", r"edit.segment.view: expected azimuth and polar angle, got \[3.0"),
        ("lobe", "edit.segment.views=40", "views: expected 12, 42, 92"),
        ("lobe", "edit.looks=true", "expected a method that follows a picture or an instruction, got seg"),
        ("arf", "fit=quick", "edit arf: expected a fit of voxels, got one of surfels"),
        ("stylesplat", "fit=plenoxels_quick", "stylesplat: expected a fit of gaussians, got one of voxels"),
        ("stylerf", "fit=quick", "edit stylerf: expected a fit of palette, got one of surfels"),
        ("dge", "fit=quick", "edit dge: expected a fit of gaussians, got one of surfels"),
        ("igs2gs_quick", "edit.looks=true", "dataset.looks of sphere: expected a look for each of TF01, got"),
        ("arf", "edit.arf.nnfm=0", "edit.arf.nnfm, edit.arf.patches: expected a weight above 0 for one of"),
        ("arf", "edit.arf.style=none.png", "edit.arf.style: expected the file of a picture, or one of"),
        ("stylerf", "edit.stylerf.styles=[dots,none.png]", "edit.stylerf.styles: expected the file of a"),
        ("stylerf", "edit.stylerf.styles=[dots,glass]", "expected one for each of 1 palette colours of fit="),
        ("dge_quick", "edit.dge.instruction=make it odd", "instruction: expected"),
        ("in2n_quick", "edit.in2n.noise=[0.9,0.1]", "edit.in2n.noise: expected two shares from 0 to 1, the"),
        ("igs2gs_quick", "edit.igs2gs.l1=0|edit.igs2gs.dssim=0", "l1, dssim, lpips: expected a weight above"),
    ],
)
def test_one_sentence_for_each(edit, word, message):
    fit = FITS.get(edit.removesuffix("_quick"), "demo")
    with pytest.raises((ArgumentError, ConfigError), match=message):
        check_edit(compose(("dataset=sphere", f"fit={fit}", f"edit={edit}", *word.split("|"))))


def require(words):
    require_edit(STAGES[f"edit_{compose(words).edit.method}"], words)


def test_what_an_edit_by_hand_starts_from_is_told_at_once(tmp_path):
    words = ("dataset=engine", "edit=crimson", f"results={tmp_path}")
    with pytest.raises(
        MissingDataError, match=r"edit\.base: lobe is not done yet; run texgs edit_segment edit=lobe"
    ):
        require(words)
    with pytest.raises(ConfigError, match=r"edit\.base: expected the file of a scene or one of"):
        require((*words, "edit.base=none-such"))
    with pytest.raises(ConfigError, match=r"edit\.parts: expected some of"):
        require(("dataset=engine", "edit=glass", "edit.parts=[nothing]"))
    require(("dataset=engine", "edit=glass"))
