"""The workflow on a tiny volume: what runs, what reruns after which change, and what a mistake looks like."""

import re
import shutil

import pytest

from tests.workflow.project import Project

pytestmark = pytest.mark.workflow


def half_written(folder):
    """Scratch files of `write_atomic`: the target's name between a dot and eight random characters."""
    return [path for path in folder.rglob(".*") if re.fullmatch(r"\..+\.[a-z0-9_]{8}", path.name)]


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    project = Project(tmp_path_factory.mktemp("project"))
    done = project.snakemake()
    assert done.returncode == 0, done.stdout + done.stderr
    return project


def test_jobs_have_logs_and_leave_no_scratch_files(project):
    results = project.work / "results"
    for tf in ("TF01", "TF02"):
        assert len(list((results / "turbulence" / tf / "views" / "train").glob("*.png"))) == 12
        assert (results / "turbulence" / tf / "sheet" / "sheet.png").stat().st_size > 1000
        assert (results / "logs" / "turbulence" / tf / "views.log").stat().st_size > 0
    assert half_written(project.work) == []


def test_a_changed_tf_reruns_only_its_views_and_names_what_it_replaces(project):
    changed = "dataset.basic_tfs.TF01.color=[[0.3,1,0,0]]"
    assert project.planned(overrides=changed) == ["sheet TF01", "transfer", "views TF01"]
    said = "results of other settings, which this run replaces; results=FOLDER keeps both"
    told = project.snakemake("-n", overrides=changed).stderr.splitlines()
    assert [line for line in told if said in line] == [
        f"texgs: results/turbulence/TF01/views and 1 more hold {said}"
    ]
    assert said not in project.snakemake("-n").stderr


def test_tracking_and_profiles_rerun_nothing(project):
    profile = project.sources / "workflow" / "profiles" / "local"
    assert project.planned("--workflow-profile", str(profile), config=("tracking=mlflow",)) == []


def test_views_may_be_given(project, tmp_path):
    other = Project(tmp_path)
    (tmp_path / "data").mkdir()
    shutil.copytree(
        project.work / "results" / "turbulence" / "TF01" / "views", tmp_path / "data" / "mine" / "TFa"
    )
    given = f"dataset.views_folder=mine data_folder={tmp_path / 'data'}"
    given += " ~dataset.basic_tfs.TF01 ~dataset.basic_tfs.TF02"
    assert other.planned(overrides=given) == ["sheet TFa"]
    done = other.snakemake(overrides=given)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (other.work / "results" / "turbulence" / "TFa" / "sheet" / "sheet.png").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"overrides": "views.widht=3"}, "texgs: views.widht: no such key, did you mean views.width?"),
        ({"config": ("datset=engine",)}, "texgs: --config: expected experiment, dataset"),
        ({"overrides": "dataset.basic_tfs.TF01.opacity=[[0.2,0],[0.6,1]]"}, "TF01 and TF02: expected ranges"),
    ],
)
def test_a_mistake_is_one_sentence_before_any_job(project, words, message):
    done = project.snakemake(**words)
    assert done.returncode == 2
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    assert len(lines) == 1, done.stderr
    assert message in lines[0]


def test_a_failing_job_says_why_and_leaves_nothing_half_written(project, tmp_path):
    other = Project(tmp_path)
    done = other.snakemake(
        targets=("results/turbulence/TF01/views/metrics.json",),
        overrides="dataset.basic_tfs.TF01.opacity=[[0.001,0],[0.002,0.001],[0.003,0]]",
    )
    assert done.returncode != 0
    assert re.fullmatch("texgs views: .*expected to see something.*", done.stderr.splitlines()[-1])
    views = other.work / "results" / "turbulence" / "TF01" / "views"
    assert not (views / "transforms_train.json").exists()
    assert not (views / "metrics.json").exists()
    assert half_written(other.work) == []


def test_lint_is_clean(project):
    done = project.snakemake("--lint")
    assert done.returncode == 0, done.stdout + done.stderr
