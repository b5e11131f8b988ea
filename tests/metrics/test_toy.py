"""A metric is one file: the stage's measures, all tables and sweeps have it, and metrics.json keeps it."""

import math
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch

import texgs.metrics.edits
from tests.metrics.test_edit_metrics import scenes, subject  # noqa: F401
from tests.refusals import refused
from tests.report.written import metrics as write_metrics
from tests.report.written import records, rows
from tests.toys.brightness import METRIC
from texgs.core.errors import ConfigError
from texgs.core.specifications import specifications
from texgs.metrics.metric import Measure, Metric, metrics, require_declared, values_of
from texgs.report.edit_tables import looks, text_driven
from texgs.report.results import EditMeasures, EditResult
from texgs.report.sweep_table import sweep

TOY = Path(__file__).parents[1] / "toys" / "brightness.py"


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """The toy among the metrics."""
    folder = tmp_path / "own_metrics"
    folder.mkdir()
    shutil.copy(TOY, folder)
    monkeypatch.setattr(texgs.metrics.edits, "__path__", [*texgs.metrics.edits.__path__, str(folder)])
    specifications.cache_clear()
    yield
    specifications.cache_clear()


@pytest.mark.usefixtures("toy")
def test_a_metric_of_one_file_is_measured_and_has_its_columns(tmp_path, scenes):  # noqa: F811
    assert list(metrics())[-1] == "brightness"
    values = values_of(subject(scenes["clear"], scenes["faint"], scenes["clear"]))
    assert 0.9 < values["brightness"] <= 1, "the scene is faint, on white"
    (folder := tmp_path / "results").mkdir()
    for facts in ({}, {"sweep": "mine", "variant": "a"}):
        edit = EditResult("gold", "text", "how", 6.0, follows="instruction", is_compared=True)
        write_metrics(folder, "edit_text", edit, **facts)
        write_metrics(folder, "edit_metrics", EditMeasures("gold", "text", values=values), **facts)
    told = "Views of the test path that measure: 2, 5, 8, 11 of 12."
    for table in (looks(records(folder)), text_driven(records(folder))):
        assert told in table.markdown()
    for table in (looks(records(folder)), text_driven(records(folder)), sweep(records(folder), "mine")):
        assert rows(table)[0]["mean brightness"] == values["brightness"]
        assert f"{values['brightness']:.3f}" in table.markdown()


@pytest.mark.parametrize(
    "given",
    [0.5, {"bleu": 1}, {"redness": torch.tensor(0.5)}, {"redness": math.nan}, {"redness": "quite red"}],
)
def test_what_a_metric_gives_is_what_it_declares(given):
    refused(
        lambda: require_declared(Metric("redness", (Measure("redness", "share of red", 2),), print), given),
        "redness",
    )


def test_two_metrics_have_no_value_of_one_name(toy, monkeypatch):
    taken = Metric("redness", (Measure("brightness", "share of red", 2),), print)
    known = specifications("texgs.metrics.edits", "METRIC")
    monkeypatch.setattr("texgs.metrics.metric.specifications", lambda *names: {**known, "redness": taken})
    refused(metrics, r"brightness and redness: .* got brightness of both; rename one", ConfigError)


def test_columns_and_names_are_stated_once():
    measures = [measure for metric in metrics().values() for measure in metric.measures]
    assert len({measure.name for measure in measures}) == len({m.title for m in measures}) == len(measures)


@pytest.mark.parametrize(
    ("made", "key"),
    [
        (lambda: replace(METRIC.measures[0], better="lower"), "measure brightness: better: "),
        (lambda: replace(METRIC.measures[0], digits="3"), "measure brightness: digits: "),
        (lambda: replace(METRIC, run=lambda before, after: {}), "metric brightness: "),
        (lambda: replace(METRIC, measures=METRIC.measures[0]), "metric brightness: measures: "),
    ],
)
def test_a_mistake_in_a_metric_is_named(made, key):
    refused(made, key, ConfigError)
