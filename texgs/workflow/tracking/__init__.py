"""Tracking with MLflow: a run per job inside of one of the workflow, in an SQLite file or on a server."""

from texgs.workflow.tracking.record import PARENT, Run, begin, process_tags, run
from texgs.workflow.tracking.store import TrackingError

__all__ = ["PARENT", "Run", "TrackingError", "begin", "process_tags", "run"]
