"""What the Snakemake of a job on a cluster reads: the plan of the run that submitted the job."""

import itertools
import json

import pytest

from tests.workflow.project import Project

pytestmark = pytest.mark.workflow

JOB = (
    "--mode",
    "remote",
    "--target-jobs",
    "transfer:dataset=turbulence",
    "--allowed-rules",
    "transfer",
    "--force",
)


def settings(project, *words, **options):
    """Names of the settings files in the commands of a dry run."""
    done = project.snakemake("--dry-run", "--printshellcmds", *words, **{"targets": (), **options})
    assert done.returncode == 0, done.stdout + done.stderr
    words = (done.stdout + done.stderr).split()
    return {word for before, word in itertools.pairwise(words) if before == "--settings"}


def test_a_job_reads_the_plan_until_anything_that_it_depends_on_changes(tmp_path):
    project = Project(tmp_path)
    planned = settings(project, targets=("volumes",))
    (plan,) = (project.work / ".snakemake" / "texgs").glob("plan-*.json")
    (transfer,) = (name for name in planned if "transfer" in name)
    plan.write_text(plan.read_text().replace(transfer, "results/.conf/transfer-of-the-plan.yaml"))

    assert settings(project, *JOB) == {"results/.conf/transfer-of-the-plan.yaml"}
    assert settings(project, *JOB, overrides="dataset.tf_values=data") != {
        "results/.conf/transfer-of-the-plan.yaml"
    }
    project.edit("conf/dataset/turbulence.yaml", "[0.3, 0.0]", "[0.31, 0.0]")
    (changed,) = settings(project, *JOB)
    assert changed not in (transfer, "results/.conf/transfer-of-the-plan.yaml")
    assert changed in json.dumps([json.loads(path.read_text()) for path in plan.parent.glob("*.json")])
