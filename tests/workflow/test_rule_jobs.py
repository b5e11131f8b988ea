"""What rules ask of a plan."""

import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest

from texgs.workflow.rule_jobs import RuleJobs, report_params, shell_prefix
from texgs.workflow.stage_table import RULES

SHADING = {
    "stage": "shading",
    "settings": "r/.conf/shading-1.yaml",
    "inputs": {"views": "r/engine/TF01/views/transforms_train.json"},
    "code": "12ab",
}


def test_a_job_is_found_by_its_wildcards():
    rule = RULES["phase"]
    wildcards = {"dataset": "engine", "tf": "TF01", "fit": "quick", "phase": "shading"}
    folder = f"r/{rule.folder.format(**wildcards)}"
    jobs = RuleJobs(SimpleNamespace(results="./r", jobs={folder: SHADING}))
    assert jobs.reads(rule)(wildcards) == ["r/.conf/shading-1.yaml", *SHADING["inputs"].values()]
    assert jobs.words(rule)(wildcards) == [
        *("shading", "--settings", "r/.conf/shading-1.yaml"),
        *("--input", "views=r/engine/TF01/views/transforms_train.json"),
        *("--output", folder),
    ]
    assert jobs.code(rule)(wildcards) == "12ab"


def test_ballots_of_a_study_go_into_the_tables(tmp_path):
    plan = SimpleNamespace(results=str(tmp_path), earlier={"a": "b"}, left_out="x.json")
    assert report_params(plan)["study"] == []
    (tmp_path / "study" / "votes").mkdir(parents=True)
    (tmp_path / "study" / "votes" / "ada.csv").touch()
    params = report_params(plan)
    assert params["ballots"] == [str(tmp_path / "study" / "votes" / "ada.csv")]
    assert params["study"] == ["--study", f"{tmp_path}/study/key.json"]


@pytest.mark.parametrize("is_shown", [True, False])
def test_commands_have_the_environment_of_jobs_and_go_on_without_a_reader(tmp_path, is_shown):
    client = tmp_path / "it's a client.py"
    client.write_text("import os, sys\nprint(os.environ['TOLD'], *sys.argv[1:])")
    prefix = shell_prefix({"TOLD": "a 'b'"}, str(client), is_shown=is_shown).format()  # as Snakemake does
    command = f"{prefix} texgs c 'd e' | tee log"
    for end in ("", " | head -c 0"):
        done = subprocess.run(["bash", "-c", command + end], cwd=tmp_path, check=False, capture_output=True)
        assert done.returncode == 0
        assert (tmp_path / "log").read_text() == "a 'b' c d e\n"
        assert bool(done.stdout) == (is_shown and not end)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("is_shown", [True, False])
def test_a_job_goes_on_where_its_log_cannot_be_written(tmp_path, is_shown):
    (tmp_path / "client.py").write_text("for _ in range(20000): print('a line')\nopen('end', 'w')")
    command = f"{shell_prefix({}, 'client.py', is_shown=is_shown).format()} texgs | tee /dev/full"
    done = subprocess.run(["bash", "-c", command], cwd=tmp_path, check=False, capture_output=True)
    assert done.returncode == 0
    assert (tmp_path / "end").exists()
