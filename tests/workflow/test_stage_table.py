"""What is wrong with a stage of one's own is told in a sentence, before it takes the place of another."""

import runpy
from dataclasses import dataclass, replace

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


def changed(**changes):
    return replace(STAGE, rule=replace(STAGE.rule, **changes))


@pytest.mark.parametrize(
    ("stage", "message"),
    [
        (dict, "toy: STAGE: expected a Stage, got type"),
        (replace(STAGE, name="my stage"), "toy: STAGE: expected letters, digits and _ in its name"),
        (changed(files=("a.png")), "toy: files of its Rule: expected names with commas"),
        (replace(STAGE, work=lambda settings, inputs: None), r"toy: work of its Stage: expected <lambda>\("),
        (changed(folder="{datset}/a"), r"folder of its Rule: expected some of {dataset}, .*, got {datset}"),
    ],
)
def test_a_stage_has_a_verb_files_and_a_folder(stage, message):
    refused(lambda: require_stage("toy", stage), message, ConfigError)
    require_stage("toy", STAGE)


@pytest.mark.parametrize(
    ("stage", "message"),
    [
        (replace(STAGE, name="sheet"), "expected stages of different names, got sheet twice"),
        (changed(target="volume"), "stage projection: target of its Rule: got volume, the name of a rule"),
        (changed(name="sheet"), "stages projection and sheet: expected a name of its own for each Rule"),
        (changed(folder="{dataset}/transfer"), "expected a folder of its own for each Rule"),
    ],
)
def test_a_stage_takes_no_place_of_another(stage, message):
    assert list(by_name(STAGES.values())) == list(STAGES)
    refused(lambda: by_name([*STAGES.values(), stage]), message, ConfigError)


def test_a_stage_takes_no_verb(monkeypatch, capsys):
    monkeypatch.setattr(stage_table, "STAGES", {**STAGES, "run": replace(STAGE, name="run")})
    with pytest.raises(SystemExit):
        runpy.run_path(main.__file__)
    assert "STAGE has the name of the verb run; rename it" in capsys.readouterr().err


def test_the_settings_of_a_stage_are_a_dataclass():
    def untold(settings, inputs, output): ...

    def wrong(settings: int, inputs, output): ...

    for work, got in ((untold, "none"), (wrong, "int")):
        with pytest.raises(ConfigError, match=f"stage projection: work: expected a dataclass .* got {got}"):
            _ = replace(STAGE, work=work).schema


@dataclass
class Misspelt:
    """Settings that read a key that there is not."""

    width: int = read("views.widths")


def test_settings_read_keys_that_there_are():
    refused(lambda: selected(Misspelt, compose(())), r"Misspelt.width: reads .* 'widths'", ConfigError)


def test_a_result_has_a_section_of_the_report():
    with pytest.raises(ConfigError, match="Misplaced: section: no section datas, did you mean data"):

        class Misplaced(Result, section="datas"): ...

    assert "Misplaced" not in Result.kinds


@dataclass(frozen=True)
class Plain:
    """No kind of Result."""

    mean: float


@pytest.mark.parametrize(
    ("outcome", "message"),
    [
        (None, "stage projection: work: expected an Outcome, got NoneType"),
        (Outcome(Plain(1)), "work: expected a kind of Result in its Outcome, got Plain"),
        (Outcome(ProjectionResult(1)), "work: expected the file projection.png in its folder, got none"),
        (Outcome(ProjectionResult(1), {"b.png": "B"}), "expected the file b.png in its folder, got none"),
    ],
)
def test_a_job_tells_and_writes_what_it_has_made(outcome, message, tmp_path):
    if outcome is not None and outcome.pictures:
        (tmp_path / "projection.png").touch()
    refused(lambda: require_outcome(STAGE, outcome, tmp_path), message, ConfigError)
