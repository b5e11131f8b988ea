"""What is wrong with a stage of one's own is told in a sentence, before it takes the place of another."""

import runpy
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.refusals import refused
from tests.toys.projection import STAGE, ProjectionResult
from texgs.cli import main
from texgs.config.compose import compose
from texgs.core.errors import ConfigError
from texgs.report.results import Result
from texgs.workflow import stage_table
from texgs.workflow.execution import require_outcome
from texgs.workflow.stage import Outcome, read, selected
from texgs.workflow.stage_table import STAGES, by_name, require_stage

TOYS = Path(__file__).parents[1] / "toys"


def changed(**changes):
    return replace(STAGE, rule=replace(STAGE.rule, **changes))


def mistaken(settings: int, inputs, output): ...


@dataclass
class Misspelt:
    """Settings that read a key that there is not."""

    width: int = read("views.widths")


def alone(stage):
    return lambda: require_stage("toy", stage)


def beside(stage):
    return lambda: by_name([*STAGES.values(), stage])


def done(outcome, *, files=("projection.py",)):
    """A job that has written its file."""
    return lambda: require_outcome(changed(files=files), outcome, TOYS)


def test_a_stage_may_be_of_ones_own():
    alone(STAGE)()
    assert [name for name in beside(STAGE)() if name != STAGE.name] == list(STAGES)
    done(Outcome(ProjectionResult(1)))()


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (alone(dict), "toy: STAGE: expected a Stage, got type"),
        (alone(replace(STAGE, name="my stage")), "toy: STAGE: expected letters, digits and _ in its name"),
        (alone(changed(files=("a.png"))), "toy: files of its Rule: expected names with commas"),
        (alone(replace(STAGE, work=lambda settings: None)), r"toy: work of its Stage: expected <lambda>\("),
        (alone(changed(folder="{datset}/a")), r"folder of its Rule: expected some of .*, got {datset}"),
        (beside(replace(STAGE, name="sheet")), "expected stages of different names, got sheet twice"),
        (beside(changed(target="volume")), "projection: target of its Rule: got volume, the name of a rule"),
        (
            beside(changed(name="sheet")),
            "stages projection and sheet: expected a name of its own",
        ),
        (beside(changed(folder="{dataset}/transfer")), "expected a folder of its own for each Rule"),
        (lambda: replace(STAGE, work=lambda settings: None).schema, "work: expected a dataclass .* got none"),
        (lambda: replace(STAGE, work=mistaken).schema, "projection: work: expected a dataclass .* got int"),
        (lambda: selected(Misspelt, compose(())), r"Misspelt.width: reads .* 'widths'"),
        (lambda: type("Misplaced", (Result,), {}, section="datas"), "Misplaced: section: no section datas"),
        (done(None), "stage projection: work: expected an Outcome, got NoneType"),
        (done(Outcome(SimpleNamespace())), "expected a kind of Result in its Outcome, got SimpleNamespace"),
        (done(Outcome(ProjectionResult(1)), files=("a.png",)), "work: expected the file a.png in its folder"),
        (
            done(Outcome(ProjectionResult(1), {"b.png": "B"})),
            "expected the file b.png in its folder",
        ),
    ],
)
def test_a_mistake_in_a_stage_is_named(call, named):
    refused(call, named, ConfigError)
    assert "Misplaced" not in Result.kinds


def test_a_stage_takes_no_verb(monkeypatch, capsys):
    monkeypatch.setattr(stage_table, "STAGES", {**STAGES, "run": replace(STAGE, name="run")})
    with pytest.raises(SystemExit):
        runpy.run_path(main.__file__)
    assert "STAGE has the name of the verb run; rename it" in capsys.readouterr().err
