"""The command of a job, which stands below its figures: typed by itself it describes the same job."""

import shlex

import pytest

from texgs.config.compose import compose
from texgs.core.cache import Checksums
from texgs.workflow.graph import graph_of
from texgs.workflow.stage_table import STAGES


@pytest.mark.parametrize(
    "words",
    [
        ("experiment=demo", "views.width=99"),
        ("experiment=paper_text_quick", "dataset=jets", "dataset.jets.views.width=99"),
        ("dataset=sphere", "sweep=lambda_s", "edit=style"),
        ("dataset=orbital", "fits=[quick,gaussians_quick]", "edits=[style,crimson]", "edit.seed=3"),
    ],
)
def test_a_command_describes_its_job_whatever_the_run_was(words):
    _, planned = graph_of(words, Checksums())
    assert len(planned.jobs) > 10
    for folder, job in planned.jobs.items():
        verb, *own = shlex.split(job.command)[1:]
        config, stage = compose(tuple(own)), STAGES[verb]
        assert stage.output(config).as_posix() == folder
        assert stage.settings(config).items() <= job.settings.items(), "which also name weights"
