# The plan of the run, and what the command lines of all jobs share.
import atexit
import os
import re
import shlex
import sys
from pathlib import Path

from texgs.cli import fork_client
from texgs.cli.run import tell_last_words
from texgs.core.errors import TexgsError
from texgs.core.cache import cache_folder
from texgs.core.process import collect_rarely, waiting
from texgs.report.table import DOCUMENT, FORMATS
from texgs.report.tables import specs
from texgs.workflow import tracked
from texgs.workflow.code import code_digest
from texgs.workflow.plan import planned, words_of
from texgs.workflow.notes import note_written
from texgs.workflow.stage_table import RULES

collect_rarely()

# A mistake of the user ends here in one sentence, before any job.
try:
    CACHE = (cache_folder() / "volumes").as_posix()
    WORDS = words_of(config)
    PLAN, MISSING = planned(WORDS, is_job=not workflow.is_main_process)
except TexgsError as error:
    print(f"texgs: {error}", file=sys.stderr)
    sys.exit(2)

# Missing files are told together and before any job; where nothing is to be done with them, that goes on.
NOTHING_IS_MADE = r"--dry-?run|--lint|--unlock|--summary|--dag|--rulegraph|-[a-zA-Z]*n[a-zA-Z]*"
if MISSING:
    print("\n".join(f"texgs: {line}" for line in MISSING), file=sys.stderr)
    if not any(re.fullmatch(NOTHING_IS_MADE, word) for word in sys.argv):
        sys.exit(2)

if workflow.is_main_process and (warning := PLAN.warning()):
    print(f"texgs: {warning}", file=sys.stderr)

PARENTS = {}  # tracked runs that hold those of jobs
RESULTS = PLAN.results
TARGETS = dict.fromkeys(each.target for each in RULES.values() if each.target)
TABLES = specs(PLAN.swept())
STUDY = Path(RESULTS, "study")  # its ballots never change, and more of them make another table
BESIDE = {  # what tables and the report show beside the jobs of this run
    "earlier": list(PLAN.earlier),
    "of_earlier": list(PLAN.earlier.values()),
    "left_out": PLAN.left_out,
    "ballots": (BALLOTS := sorted(map(str, STUDY.glob("votes/*.csv")))),
    "study": ["--study", f"{STUDY}/key.json"] if BALLOTS else [],
}
config["captions"] = {
    each.name: each.shown for each in RULES.values()
}  # what workflow/report/figure.rst shows


def job(each, wildcards):
    """Folder of the job that wildcards describe, and what the plan says of it."""
    folder = Path(RESULTS, each.folder.format(**dict(wildcards.items()))).as_posix()
    return folder, PLAN.jobs[folder]


def reads(each):
    """The files a job reads, first its settings, as a function of wildcards."""

    def of(wildcards):
        _, planned = job(each, wildcards)
        return [planned["settings"], *planned["inputs"].values()]

    return of


def writes(each):
    """The files a job writes that others read; pictures go into the report of Snakemake, too."""

    def of(file):
        path = f"<results>/{each.folder}/{file}"
        if file not in each.shown:
            return path
        return report(path, caption="../report/figure.rst", category=each.target, subcategory=each.name)

    return [of(file) for file in (*each.files, "metrics.json")]


def words(each):
    """The words of a job's command, first its stage, as a function of wildcards."""

    def of(wildcards):
        folder, planned = job(each, wildcards)
        inputs = [f"{name}={path}" for name, path in planned["inputs"].items()]
        files = ["--input", *inputs] if inputs else []
        return [planned["stage"], "--settings", planned["settings"], *files, "--output", folder]

    return of


def code(each):
    """The digest of the code that a job runs, as a function of wildcards."""
    return lambda wildcards: job(each, wildcards)[1]["code"]


def log_of(each):
    """The log of a job."""
    return f"<logs>/{each.folder}.log"


def any_of(names, otherwise="none"):
    """A wildcard's values."""
    return "|".join(map(re.escape, names)) or otherwise


def begin():
    """Hold the results, begin the tracked runs that hold those of jobs, and start what forks the jobs."""
    global RUN_LOCK, FORK_SERVER, PARENTS
    from texgs.cli import fork_server
    from texgs.workflow.result import run_alone

    try:
        RUN_LOCK = run_alone(RESULTS)  # it goes with the process, however that ends
        if workflow.local_exec:
            # A limit of jobs a second makes Snakemake look at all jobs once more after each look, so that a long
            # run looks at them all the time, with half of a core: github.com/snakemake/snakemake/issues/2967.
            workflow.scheduler.job_rate_limiter = None
        jobs = [job for job in workflow.dag.needrun_jobs() if job.rule.name in RULES]
        if workflow.local_exec and len(jobs) > 1:
            FORK_SERVER = fork_server.start(ENVIRONMENT)
        PARENTS = tracked.begin_runs(PLAN, WORDS)
    except TexgsError as error:
        print(f"texgs: {error}", file=sys.stderr)
        sys.exit(2)


def finish(status):
    """End the tracked runs that hold those of jobs; returns all files that the workflow makes."""
    made = {str(file) for each in workflow.dag.jobs for file in each.output}
    if status == "FINISHED":
        note_written(RESULTS, made)
    tracked.end_runs(PARENTS, status, PLAN, made)
    return made


# In front of the commands, not a parameter of the rules: where runs are recorded and how threads wait changes no
# result.
ENVIRONMENT = waiting() | {"TEXGS_RUNS": tracked.runs_file(RESULTS)}
if PLAN.tracking is not None:
    ENVIRONMENT |= {
        "TEXGS_TRACKING": PLAN.tracking,
        "TEXGS_EXPERIMENT": PLAN.experiment,
    }
CLIENT = fork_client.__file__
SETTING = " ".join(f"{name}={shlex.quote(value)}" for name, value in ENVIRONMENT.items())
# A job goes on where nobody reads its output any more, and so does its log: tee would end with a signal, or where
# it is BSD's, at its end with an error.
shell.prefix(
    "set -euo pipefail; trap '' PIPE; tee() {{ command tee \"$@\" || true; }}; "
    f'texgs() {{{{ {SETTING} {shlex.quote(sys.executable)} -PSE {shlex.quote(CLIENT)} "$@"; }}}}; '
)
# One command for all stages. Snakemake removes the log of an earlier attempt.
RUN = "texgs {params.words:q} 2>&1 | tee {log:q}"


# What is there stays until the job has made something better: it swaps its files in at the end.
outputflags:
    update,


pathvars:
    results=RESULTS,
    logs=f"{RESULTS}/logs",


wildcard_constraints:
    dataset=any_of(PLAN.wildcards["dataset"]),
    tf="[A-Za-z][A-Za-z0-9_-]*",
    views=any_of(PLAN.wildcards["views"]),
    fit=any_of(PLAN.wildcards["fit"]),
    phase=any_of(PLAN.wildcards["phase"]),
    edit=any_of(PLAN.wildcards["edit"], "no-edit"),
    gallery=any_of(PLAN.wildcards["gallery"]),
