"""Which configurations of an experiment show its recipes side by side, and which models they take."""

import pytest

from texgs.config.compose import compose
from texgs.workflow.stage_table import STAGES

WORDS = ("dataset=engine", "tf=TF01", "fits=[quick,gaussians_quick]", "fit.seed=3")
COMPARISON = STAGES["comparison"]


def test_its_models_are_those_of_the_last_phases_of_all_recipes():
    inputs = COMPARISON.inputs(compose((*WORDS, "fit=gaussians_quick")))
    assert {name: path.as_posix() for name, path in inputs.items()} == {
        "quick": "results/engine/TF01/quick-s3/texture/model.safetensors",
        "gaussians_quick": "results/engine/TF01/gaussians_quick-s3/gaussians/model.safetensors",
        "views": "results/engine/TF01/views/transforms_train.json",
    }


@pytest.mark.parametrize(
    ("words", "applies"),
    [
        (("fit=quick",), True),
        (("fit=gaussians_quick",), False),  # the first one stands for all
        (("fit=quick", "fits=[quick]"), False),
        (("fit=quick", "sweep=views"), False),
        (("fit=quick", "edit=glass"), False),
    ],
)
def test_one_configuration_stands_for_all(words, applies):
    assert COMPARISON.applies(compose((*WORDS, *words))) is applies
