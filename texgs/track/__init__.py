"""Tracking of jobs with MLflow: a run per job, in a local SQLite file or on a server."""

from texgs.track.errors import TrackingError
from texgs.track.record import Run, run

__all__ = ["Run", "TrackingError", "run"]
