"""Tracking with MLflow: a run per job inside of one of the workflow, in an SQLite file or on a server."""

from texgs.workflow.tracking.dead import process_tags
from texgs.workflow.tracking.errors import TrackingError
from texgs.workflow.tracking.parents import PARENT, Parent, open_parents
from texgs.workflow.tracking.record import Run, close_dead_runs, run

__all__ = [
    "PARENT",
    "Parent",
    "Run",
    "TrackingError",
    "close_dead_runs",
    "open_parents",
    "process_tags",
    "run",
]
