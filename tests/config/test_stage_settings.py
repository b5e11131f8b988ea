"""The dataclass of a stage has all values that its row selects, and no others."""

from dataclasses import is_dataclass

import pytest

from texgs.config.compose import compose
from texgs.config.project import members
from texgs.core.keys import typed
from texgs.workflow.stage_table import STAGES

TF = ("dataset=turbulence", "tf=TF01")
WORDS = {  # of stages that read more than the data set
    **dict.fromkeys(("views", "sheet", "surfels", "shading", "texture", "figure", "mesh"), TF),
    "comparison": (*TF, "fits=[quick,demo]"),
    "gaussians": (*TF, "fit=gaussians_quick"),
    "voxels": (*TF, "fit=plenoxels_quick"),
    "palette": (*TF, "fit=stylerf_quick"),
    **{
        f"edit_{compose((f'edit={name}',)).edit.method}": ("dataset=turbulence", f"edit={name}")
        for name in members("edit")
    },
    "gallery": ("dataset=turbulence", "edits=[gold]"),
    "edit_metrics": ("dataset=turbulence", "edit=gold"),
}


def same(selected, instance):
    """Whether an instance has the selected values, tables and lists of tables included."""
    if isinstance(selected, dict):
        get = instance.__getitem__ if isinstance(instance, dict) else lambda name: getattr(instance, name)
        return all(same(value, get(name)) for name, value in selected.items())
    if isinstance(selected, list):
        return len(selected) == len(instance) and all(map(same, selected, instance))
    return selected == instance and type(selected) is type(instance)


@pytest.mark.parametrize("name", list(STAGES))
def test_a_stage_reads_what_its_row_selects(name):
    stage = STAGES[name]
    selected = stage.settings(compose(WORDS.get(name, ("dataset=turbulence",))))
    if stage.place in ("edit", "edit_metrics"):
        selected["weights"] = {"vgg16": "0123", "lpips_vgg": None}
    settings = typed(stage.schema, selected)
    assert is_dataclass(settings)
    assert same(selected, settings)
