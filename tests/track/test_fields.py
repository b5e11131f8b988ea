from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mlflow.utils.validation import _validate_metric_name

from texgs.workflow.tracking import fields


def test_nested_parameters_become_dotted_names_and_text():
    params = {
        "fit": {"steps": 30000, "rate": {"means": 1.6e-4}, "windows": [1, 2.5, None]},
        "shaded": True,
        "mask": None,
        "edits": {},
        "volume": Path("engine.vti"),
        "prompt": 'a "blue" one',
    }
    assert fields.flatten(params) == {
        "fit.steps": "30000",
        "fit.rate.means": "0.00016",
        "fit.windows": "[1, 2.5, null]",
        "shaded": "true",
        "mask": "null",
        "edits": "{}",
        "volume": "engine.vti",
        "prompt": 'a "blue" one',
    }


def test_long_values_are_cut():
    text = fields.flatten({"long": "x" * 9000})["long"]
    assert len(text) == fields.LONGEST_PARAM
    assert text.endswith("x…")


@pytest.mark.parametrize(
    ("given_name", "expected"),
    [
        ("wildcards.dataset", "wildcards.dataset"),
        ("psnr/TF01", "psnr/TF01"),
        ("clip@512", "clip_512"),
        ("../a//b/", "a/b"),
        ("", "_"),
    ],
)
def test_names(given_name, expected):
    assert fields.allowed_name(given_name) == expected


@given(st.text(max_size=300))
def test_every_name_is_one_that_mlflow_takes(text):
    name = fields.allowed_name(text)
    _validate_metric_name(name)
    assert len(name) <= fields.LONGEST_NAME
