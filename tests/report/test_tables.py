from pathlib import Path

import pytest

from tests.refusals import refused
from tests.report.written import lines, metrics, records
from tests.study.studies import study
from texgs.cli.main import main
from texgs.core.cache import Checksums
from texgs.core.io import read_json, write_json
from texgs.core.names import METRICS
from texgs.report.metrics_files import LeftOut, read_known, require_apart
from texgs.report.results import SECTIONS, EditResult, FitResult, SceneResult
from texgs.report.tables import specs, tables_of
from texgs.study.ballots import Ballot, Votes
from texgs.study.votes import study_table
from texgs.workflow.result import claim, fingerprint, publish
from texgs.workflow.stage_table import STAGES

TABLES = specs()


def test_tables_of_the_paper_come_first_and_none_twice():
    numbers = [table.number for table in TABLES]
    assert all(numbers[: 1 + max(map(numbers.index, filter(None, numbers)))])
    assert len({table.name for table in TABLES}) == len(TABLES)


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.name)
def test_a_table_names_places_and_a_section_that_there_are_and_of_nothing_has_no_rows(table):
    assert set(table.places) <= {stage.place for stage in STAGES.values()}
    assert table.section in SECTIONS
    assert table.table([]).frame.empty


def test_the_papers_numbers_are_all_there():
    names = ("fitting", "datasets", "views", "resolution", "model_size")
    assert [len(lines(name)) for name in names] == [8 * 3, 12, 4, 3, 4]


def test_each_sweep_of_fits_has_a_table(tmp_path):
    numbers = FitResult(60.0, 9, psnr=30.0)
    metrics(tmp_path, "compose", SceneResult(1, 9), sweep="other", variant="a")
    for phase in ("surfels", "shading", "texture"):
        metrics(tmp_path, phase, numbers, tf="TF01", sweep="mine", variant="a")
        metrics(tmp_path, phase, numbers, tf="TF01")
    tables = tables_of(records(tmp_path))
    assert [name for name in tables if name.startswith("sweep")] == [list(tables)[-1]] == ["sweep-mine"]
    assert len(tables["sweep-mine"].frame) == 1
    assert tables["fits"].frame["TF"].tolist() == ["TF01"] * 3


def test_a_user_study_has_its_votes_and_without_them_the_papers_where_its_data_are_edited(tmp_path):
    edit = EditResult("glass", "image", "how", 6.0, follows="style")
    metrics(tmp_path, "edit_image", edit, "scan")
    assert study_table(records(tmp_path), None).is_empty
    votes = Votes(study("xyz"), [Ballot("a", [[1, 2, 3]])])
    assert "1 ballots" in study_table(records(tmp_path), votes).caption
    metrics(tmp_path, "edit_image", edit, "engine")
    given = {"user_study": study_table(records(tmp_path), None)}
    table = tables_of(records(tmp_path), given=given)["user_study"]
    assert "No votes but the paper's." in table.caption
    assert set(table.frame["edit"]) == {"the paper"}


def test_captions_say_what_is_left_out(tmp_path):
    tables, words = tables_of([], [LeftOut("data set wood", "no file", ["phase"])]), "wood: no file."
    said = {name for name, table in tables.items() if table.caption.endswith(f"Left out: data set {words}")}
    assert said == {"fitting", "views", "resolution", "model_size", "fits", "differences"}


def test_the_verb_writes_three_files_a_table_and_a_document(tmp_path, capsys):
    path = metrics(tmp_path, "shading", FitResult(60.0, 9, psnr=40.0), "scan", "TF01")
    old = tmp_path / "old.json"
    old.write_text('{"stage": "texture", "dataset": "engine", "numbers": {"surfels": 9}}')
    missing = tmp_path / "missing.json"
    missing.write_text('[{"what": "data set wood", "why": "no file", "places": ["phase"]}]')
    words = ["--missing", str(missing), "--output", str(tmp_path / "tables")]
    assert main(["tables", str(path), str(path), str(old), *words]) == 0
    expected = {f"{table.name}.{kind}" for table in TABLES for kind in ("csv", "md", "tex")}
    assert {file.name for file in (tmp_path / "tables").iterdir()} == expected | {"tables.tex"}
    said = capsys.readouterr()
    assert said.out.count("| scan | quick | shading | 1 | 40.00 |") == 1, "a file counts once"
    assert "Left out: data set wood: no file." in said.out
    assert "Left out: 1 metrics file: of another version of texgs" in said.err
    assert "## Table 1. Data sets" not in said.out, "tables without rows are not printed"
    for option in ("--missing", "--study"):
        for verb in ("tables", "report"):
            assert main([verb, str(path), option, "nothing.json"]) == 2
            assert f"{option}: expected a file that texgs" in capsys.readouterr().err


def test_tables_of_a_folder_go_there(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("texgs.workflow.graph.earlier_results", lambda *_: ([str(path)], {}))
    path = metrics(tmp_path, "shading", FitResult(60.0, 9, psnr=40.0), "scan", "TF01")
    (tmp_path / "other").mkdir()
    assert main(["tables", "other"]) == 0
    assert main(["report", "other"]) == 0
    assert main(["tables", str(path)]) == 0
    capsys.readouterr()
    assert (tmp_path / "other" / "tables" / "fits.csv").is_file()
    assert (tmp_path / "other" / "report.html").is_file()
    assert (tmp_path / "results" / "tables" / "fits.csv").is_file()
    assert not (tmp_path / "results" / "report.html").exists()


def test_the_verb_reads_whole_results_of_a_folder_and_names_others(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["tables", "mine"]) == 2
    assert "mine: expected a metrics file or a folder of results, got none" in capsys.readouterr().err
    for name, psnr in (("views", None), ("fit", 40.0)):
        folder = Path("mine", "scan", "TF01", name)
        work = claim(folder, {"settings": name})
        (work / "made.txt").write_text(name)
        shown = metrics(tmp_path, "shading", FitResult(60.0, 9, psnr=psnr), "scan", "TF01")
        facts = read_json(shown) | {"inputs": {}, "made_from": {}}
        if name == "fit":
            views = folder.with_name("views") / "made.txt"
            facts |= {
                "inputs": {"v": fingerprint(views, Checksums())},
                "made_from": {"v": "../views/made.txt"},
            }
        write_json(work / METRICS, facts)
        publish(folder)
        shown.unlink()
    assert main(["tables", "mine", "--output", "t"]) == 0
    assert "40.00" in capsys.readouterr().out
    work = claim(Path("mine/scan/TF01/views"), {"settings": "others"})
    (work / "made.txt").write_text("others")
    write_json(work / METRICS, read_json("mine/scan/TF01/views/metrics.json"))
    publish(Path("mine/scan/TF01/views"))
    assert main(["tables", "mine", "--output", "t"]) == 0
    said = capsys.readouterr()
    assert "40.00" not in said.out
    assert "mine/scan/TF01/fit: comes from mine/scan/TF01/views, which has been made anew since" in said.err


def fit_in(folder, stage, dataset, tf="TF01"):
    """The metrics file of a fit in a folder."""
    folder.mkdir(parents=True)
    return metrics(folder, stage, FitResult(60.0, 9, psnr=40.0), dataset, tf, name=METRICS)


def test_results_of_two_folders_are_not_mixed(tmp_path):
    roots = ("one", "scan/two")  # a project may be named like its data
    paths = [fit_in(tmp_path / root / "scan" / "TF01", "shading", "scan") for root in roots]
    refused(lambda: require_apart(read_known(paths)[0]), r"two/scan.*: .*one/scan")


def test_a_data_set_may_have_the_name_of_a_stage(tmp_path):
    folder, stage = tmp_path / "results" / "texture", "texture"
    require_apart(read_known([fit_in(folder / tf / stage, stage, stage, tf) for tf in ("TF01", "TF02")])[0])


def test_columns_of_the_paper_without_a_value_are_left_out(tmp_path):
    metrics(tmp_path, "surfels", FitResult(60.0, 9, psnr=40.0), "scan", "TF01")
    own = tables_of(records(tmp_path))["fitting"].titles
    assert "PSNR" in own
    assert not [title for title in own if title.endswith("(paper)")]
    metrics(tmp_path, "surfels", FitResult(60.0, 9, psnr=40.0), "engine", "TF01")
    assert "PSNR (paper)" in tables_of(records(tmp_path))["fitting"].titles
