"""Tracking of jobs with MLflow: a run per job, in a local SQLite file or on a server."""

from texgs.track.dead import process_tags
from texgs.track.errors import TrackingError
from texgs.track.record import Run, close_dead_runs, run

__all__ = ["Run", "TrackingError", "close_dead_runs", "process_tags", "run"]
