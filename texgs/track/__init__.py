"""Tracking with MLflow: a run per job inside of one of the workflow, in an SQLite file or on a server."""

from texgs.track.dead import process_tags
from texgs.track.errors import TrackingError
from texgs.track.parents import PARENT, Parent, open_parents
from texgs.track.record import Run, close_dead_runs, run

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
