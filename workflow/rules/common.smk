# The plan of the run, and what all rules share.
#
# The plan has each job of the run by the folder of its result: its settings, the files that it reads and the digest
# of its code. A rule (stages.smk) is for one kind of result; its wildcards are parts of that folder, by which JOBS
# finds the job in the plan.
import re
import sys
from functools import partial

from texgs.cli import fork_client, fork_server
from texgs.cli.snakemake import WorkflowRun
from texgs.core.errors import TexgsError
from texgs.core.cache import cache_folder
from texgs.core.memory import collect_rarely
from texgs.report.table import DOCUMENT, FORMATS
from texgs.report.tables import specs
from texgs.workflow.code import code_digest
from texgs.workflow.plan import planned, words_of
from texgs.workflow.rule_jobs import RuleJobs, environment_of, report_params, shell_prefix
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

if workflow.is_main_process:
    print("".join(f"texgs: {line}\n" for line in PLAN.warnings()), end="", file=sys.stderr)

JOBS = RuleJobs(PLAN)
RESULTS = PLAN.results
TARGETS = dict.fromkeys(each.target for each in RULES.values() if each.target)
TABLES = specs(PLAN.swept())
# What workflow/report/figure.rst shows.
config["captions"] = {each.name: each.shown for each in RULES.values()}

# In front of the commands, not a parameter of the rules: it changes no result.
ENVIRONMENT = environment_of(PLAN)
RUN = WorkflowRun(workflow, PLAN, WORDS, partial(fork_server.start, ENVIRONMENT))
shell.prefix(shell_prefix(ENVIRONMENT, fork_client.__file__, is_shown=not RUN.has_own_log))


def any_of(names, otherwise="none"):
    """A wildcard's values."""
    return "|".join(map(re.escape, names)) or otherwise


def made(each):
    """The files of a job that others read; pictures go into the report of Snakemake, too."""
    for file in (*each.files, "metrics.json"):
        path = f"<results>/{each.folder}/{file}"
        in_report = {"caption": "../report/figure.rst", "category": each.target, "subcategory": each.name}
        yield report(path, **in_report) if file in each.shown else path


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
