"""Which looks of an experiment stand side by side."""

import pytest

from texgs.config.compose import compose
from texgs.config.stages import STAGES
from texgs.core.errors import ConfigError

GALLERY = STAGES["gallery"]


def test_each_look_is_there_once_for_each_recipe_that_its_method_takes():
    words = ("fits=[quick,gaussians_quick]", "edits=[glass,lobe,stylesplat]", "fit=quick")
    inputs = GALLERY.inputs(compose(("dataset=engine", *words)))
    scenes = "results/engine/scene"
    assert {name: path.as_posix() for name, path in inputs.items()} == {
        "before": f"{scenes}/quick/compose/scene.yaml",
        "glass": f"{scenes}/quick/edits/glass/scene.yaml",
        "stylesplat": f"{scenes}/gaussians_quick/edits/stylesplat/scene.yaml",
    }, "a segment is no look"
    inputs = GALLERY.inputs(
        compose(("dataset=engine", "fits=[quick,demo]", "edits=[glass,gold]", "fit=quick"))
    )
    assert list(inputs) == ["before", "glass, quick", "glass, demo", "gold, quick", "gold, demo"]


@pytest.mark.parametrize(
    ("words", "applies"),
    [
        (("fit=quick",), True),
        (("fit=gaussians_quick",), False),  # the first one stands for all
        (("fit=quick", "edits=[glass]"), False),
        (("fit=quick", "edit=glass"), False),
        (("fit=quick", "tf=TF01"), False),
    ],
)
def test_one_configuration_stands_for_all(words, applies):
    given = ("dataset=engine", "fits=[quick,gaussians_quick]", "edits=[glass,stylesplat]")
    assert GALLERY.applies(compose((*given, *words))) is applies


def test_without_edits_there_is_nothing_to_show():
    with pytest.raises(ConfigError, match="edits: expected some to show"):
        GALLERY.inputs(compose(("dataset=engine", "fit=quick")))
