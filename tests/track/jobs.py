"""Eight jobs that start at once, on one store after another; fails where one of them does.

`python -m tests.track.jobs FILE URI...`
"""

import multiprocessing
import sys

# Here, so that the children start at once and do not load them again.
import alembic.script  # noqa: F401
import mlflow.artifacts
import mlflow.store.db.utils
import mlflow.store.tracking.sqlalchemy_store  # noqa: F401

from texgs.workflow.tracking import run

N_JOBS = 8
N_METRICS = 20


def job(index, barrier, uri, file):
    barrier.wait()
    tags = {"snakemake.rule": "fit", "wildcards.dataset": f"volume {index}"}
    with run(
        uri, experiment="race", name=f"job {index}", tags=tags, params={"fit": {"seed": index}}
    ) as record:
        for step in range(N_METRICS):
            record.log({"loss": index + step / 100}, step)
        record.artifact(file, "images")
    sys.exit(record.lost)


def failures(uri, file):
    """How many of the jobs on a store fail."""
    context = multiprocessing.get_context("fork")
    barrier = context.Barrier(N_JOBS)
    jobs = [context.Process(target=job, args=(index, barrier, uri, file)) for index in range(N_JOBS)]
    for process in jobs:
        process.start()
    for process in jobs:
        process.join()
    return sum(process.exitcode != 0 for process in jobs)


if __name__ == "__main__":
    sys.exit(sum(failures(uri, sys.argv[1]) for uri in sys.argv[2:]))
