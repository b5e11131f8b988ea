"""What is wrong with a stage of one's own is told in a sentence, before it takes the place of another."""

import runpy
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from tests.toys.projection import STAGE, ProjectionResult
from texgs.cli import main
from texgs.config.compose import compose
from texgs.core.errors import ConfigError
from texgs.report.results import Result
from texgs.workflow import stage_table
from texgs.workflow.execution import require_outcome
from texgs.workflow.stage import Outcome, Rule, read, values_read
from texgs.workflow.stage_table import STAGES, by_name, require_stage

TOYS = Path(__file__).parent  # a folder without results


class Untyped:
    """Works of stages that do not say what their settings are."""

    @staticmethod
    def bare(settings, inputs, output): ...

    @staticmethod
    def number(settings: int, inputs, output): ...


@dataclass
class Misspelt:
    """Settings that read a key that there is not."""

    width: int = read("views.widths")


@dataclass(frozen=True)
class Plain:
    """No kind of Result."""

    mean: float


def among_all(**changes):
    return by_name([*STAGES.values(), replace(STAGE, **changes)])


def rule(**changes):
    return {"rule": replace(STAGE.rule, **changes)}


@pytest.mark.parametrize(
    ("made", "key"),
    [
        (lambda: require_stage("toy", dict), "toy: STAGE: .* got type"),
        (lambda: require_stage("toy", replace(STAGE, name="my stage")), "toy: STAGE: .* name"),
        (lambda: require_stage("toy", replace(STAGE, **rule(files="a.png"))), "toy: files of its Rule"),
        (lambda: require_stage("toy", replace(STAGE, work=lambda settings, inputs: None)), "toy: work"),
        (lambda: require_stage("toy", replace(STAGE, **rule(folder="{datset}/a"))), "got {datset}"),
        (lambda: among_all(name="sheet"), "sheet twice"),
        (lambda: among_all(**rule(target="volume")), "stage projection: target of its Rule"),
        (lambda: among_all(**rule(name="sheet")), "stages projection and sheet: .* name"),
        (lambda: among_all(**rule(folder="{dataset}/transfer")), "folder .* {dataset}/transfer twice"),
        (lambda: replace(STAGE, work=Untyped.bare).schema, "stage projection: work: .* got none"),
        (lambda: replace(STAGE, work=Untyped.number).schema, "stage projection: work: .* got int"),
        (lambda: values_read(Misspelt, compose(())), r"Misspelt\.width: .* 'widths'"),
        (lambda: type("Misplaced", (Result,), {}, section="datas"), "Misplaced: section"),
        (lambda: require_outcome(STAGE, None, TOYS), "stage projection: work: .* got NoneType"),
        (lambda: require_outcome(STAGE, Outcome(Plain(1)), TOYS), "work: .* got Plain"),
        (lambda: require_outcome(STAGE, Outcome(ProjectionResult(1)), TOYS), r"projection\.png"),
        (
            lambda: require_outcome(
                replace(STAGE, **rule(files=())), Outcome(ProjectionResult(1), {"b.png": "B"}), TOYS
            ),
            r"b\.png",
        ),
    ],
)
def test_a_mistake_in_a_stage_is_named(made, key):
    with pytest.raises(ConfigError, match=key):
        made()


def test_the_stages_that_there_are_have_no_mistakes():
    require_stage("toy", STAGE)
    assert list(by_name(STAGES.values())) == list(STAGES)


def test_a_stage_takes_no_verb(monkeypatch, capsys):
    monkeypatch.setattr(stage_table, "STAGES", {**STAGES, "run": replace(STAGE, name="run")})
    with pytest.raises(SystemExit):
        runpy.run_path(main.__file__)
    assert "STAGE has the name of the verb run; rename it" in capsys.readouterr().err


def test_a_rule_may_have_several_stages():
    assert isinstance(STAGES["surfels"].rule, Rule)
    assert STAGES["surfels"].rule == STAGES["texture"].rule
