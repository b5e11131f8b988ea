# Configuration, data sets with their basic TFs, and what the command lines of all jobs share.
import re
import shlex
import sys
from importlib.resources import files
from pathlib import Path

from texgs.cli.job import Job
from texgs.cli.result import METRICS, run_alone
from texgs.cli.stages.tf import check_basic_tfs
from texgs.config.code import code_digest, digest
from texgs.config.compose import compose
from texgs.config.edits import edits
from texgs.config.locate import tf_names
from texgs.config.stage import EDITS, FOLDERS, fit_folder, for_tf, note_result, settings_file
from texgs.config.stages import STAGES
from texgs.config.sweep import variants
from texgs.core.checksum import Checksums
from texgs.core.errors import ConfigError, MissingDataError, TexgsError
from texgs.track import close_dead_runs

GROUPS = ("experiment", "dataset", "views", "fit", "edit", "sweep", "device", "tracking")


def overrides():
    """What `--config` says, in Hydra's syntax."""
    if unknown := sorted(set(config) - {*GROUPS, "overrides", "pathvars"}):
        expected = ", ".join(GROUPS)
        raise ConfigError(
            f'--config: expected {expected} or overrides="KEY=VALUE ...", got {", ".join(unknown)}'
        )
    lists = [group for group in GROUPS if not isinstance(config.get(group, ""), str)]
    if lists:
        raise ConfigError(
            f"{lists[0]}: expected one name, got {config[lists[0]]}; several data sets go to datasets=[...]"
        )
    groups = [f"{group}={config[group]}" for group in GROUPS if group in config]
    try:
        return (*groups, *shlex.split(str(config.get("overrides", ""))))
    except ValueError as error:
        raise ConfigError(f"overrides: {error}; put a word in quotes before the last one") from error


def experiments(words):
    """Configurations by the name of their sweep, None for those of none: one for each data set and variant or edit."""
    base = compose(words)
    names = [(*words, f"dataset={name}") for name in base.datasets] or [words]
    repeated = [name for name in base.datasets if base.datasets.count(name) > 1]
    if repeated:
        raise ConfigError(f"datasets: expected different names, got {repeated[0]} twice")
    found = {}
    for each in names:
        config = compose(each)
        name = config.sweep.name if config.sweep.variants else None
        fitted = (*each, "edit=none")
        found.setdefault(name, []).extend(compose(variant) for variant in variants(fitted))
        if name is None:
            found[name] += [compose(edit) for edit in edits(each)]
    for name, dataset in base.sweeps.items():
        found[name] = [
            compose(variant)
            for variant in variants((*words, f"dataset={dataset}", f"sweep={name}", "edit=none"))
        ]
    return found


def jobs(configs):
    """The jobs by stage and folder; and what is missing for some."""
    found, missing = {}, []
    for config in configs:
        check_basic_tfs(config.dataset)
        try:
            by_tf = [for_tf(config, name) for name in tf_names(config)]
        except MissingDataError as error:
            missing.append(str(error))
            continue
        for name, stage in STAGES.items():
            for each in (by_tf if stage.per_tf else [config]) if stage.applies(config) else ():
                try:
                    made = Job.of(stage, each, CHECKSUMS)
                except MissingDataError as error:
                    missing.append(str(error))
                    made = Job(stage, stage.settings(each), {}, stage.output(each))
                if found.setdefault((name, made.output.as_posix()), made) != made:
                    raise ConfigError(f"{made.output}: two variants go there; give one another name")
    return found, list(dict.fromkeys(missing))


def job(stage, wildcards):
    """The job that wildcards describe."""
    return JOBS[stage, Path(RESULTS, FOLDERS[stage].format(**dict(wildcards.items()))).as_posix()]


def reads(stage):
    """The files a job reads, first its settings, as a function of wildcards."""

    def of(wildcards):
        made = job(stage, wildcards)
        files = [path.as_posix() for path in made.inputs.values()]
        return [settings_file(made.settings, RESULTS), *files]

    return of


def words(stage):
    """The command line of a job after the name of its stage, as a function of wildcards."""

    def of(wildcards):
        made = job(stage, wildcards)
        files = [f"{name}={path.as_posix()}" for name, path in made.inputs.items()]
        inputs = ["--input", *files] if files else []
        settings = settings_file(made.settings, RESULTS)
        return ["--settings", settings, *inputs, "--output", made.output.as_posix()]

    return of


def renew_settings():
    """Change the settings files of jobs whose results are not whole, or not of these jobs.

    Snakemake knows of inputs and parameters. That a result is damaged, or that a job failed and left the result
    before it in place, it learns by this. It takes a file for changed where its contents are.
    """
    for made in JOBS.values():
        if (made.output / METRICS).exists() and not made.is_done():
            note_result(settings_file(made.settings, RESULTS), f"{made.output}: not whole, or of another job")


def done(*stages, sweep=None):
    """The metrics files of all jobs of some stages, of a sweep or of none."""
    return sorted(f"{folder}/metrics.json" for stage, folder in OF_SWEEP.get(sweep, ()) if stage in stages)


def edits_of(kind):
    """The wildcard's values: names of edits of a kind."""
    names = sorted({re.escape(each.edit.name) for each in CONFIGS if each.edit.kind == kind})
    return "|".join(names) or "no-edit"


def missing_weights(configs):
    """What edits need and this machine has not; mistakes in edits are told first."""
    edited = [config for config in configs if config.edit.kind != "none"]
    if not edited:
        return []
    from texgs.cli.edits import check_edit  # not at the top: most runs have no edits
    from texgs.cli.weights import missing

    for config in edited:
        check_edit(config)
    return list(dict.fromkeys(line for config in edited for line in missing(config)))


def begin():
    """Hold the results before the first job, and close the tracked runs of processes that were killed."""
    global RUN_LOCK
    try:
        RUN_LOCK = run_alone(RESULTS)  # it goes with the process, however that ends
        close_dead_runs(STORE, CONFIG.tracking.experiment)
    except TexgsError as error:
        print(f"texgs: {error}", file=sys.stderr)
        sys.exit(2)


IS_DRY = any(re.fullmatch(r"--dry-?run|--lint|-[a-zA-Z]*n[a-zA-Z]*", word) for word in sys.argv)

CHECKSUMS = Checksums.load()

# A mistake of the user ends here in one sentence, before any job.
try:
    WORDS = overrides()
    CONFIG = compose(WORDS)
    EXPERIMENTS = experiments(WORDS)
    CONFIGS = [config for configs in EXPERIMENTS.values() for config in configs]
    RESULTS = CONFIG.results
    JOBS, MISSING = jobs(CONFIGS)
    MISSING += missing_weights(CONFIGS)
    OF_SWEEP = {sweep: set(jobs(configs)[0]) for sweep, configs in EXPERIMENTS.items()}
    if workflow.is_main_process:
        renew_settings()
        CHECKSUMS.save()
except TexgsError as error:
    print(f"texgs: {error}", file=sys.stderr)
    sys.exit(2)

# Missing files are told together and before any job; a dry run shows what would be done with them.
if MISSING:
    print("\n".join(f"texgs: {line}" for line in MISSING), file=sys.stderr)
    if not IS_DRY:
        sys.exit(2)

STORE = CONFIG.tracking.uri
MAPPER_GPU, FIT_GPU = int(CONFIG.device.mapper == "gpu"), int(CONFIG.device.name == "cuda")

# In front of the commands, not a parameter of the rules: where runs are recorded changes no result.
ENVIRONMENT = (
    {} if STORE is None else {"TEXGS_TRACKING": STORE, "TEXGS_EXPERIMENT": CONFIG.tracking.experiment}
)
SETTING = " ".join(f"{name}={shlex.quote(value)}" for name, value in ENVIRONMENT.items())
shell.prefix(
    "set -euo pipefail; "
    f'texgs() {{{{ {SETTING} {shlex.quote(sys.executable)} -P -m texgs.cli.main "$@"; }}}}; '
)

# One command for all stages: a rule has the name of its stage.
RUN = "texgs {rule} {params.words:q} 2>&1 | tee {log:q}"


# What is there stays until the job has made something better: it swaps its files in at the end.
outputflags: update


pathvars:
    results=RESULTS,
    logs=f"{RESULTS}/logs",
    benchmarks=f"{RESULTS}/benchmarks",


wildcard_constraints:
    sweep="|".join(map(re.escape, filter(None, EXPERIMENTS))) or "no-sweep",
    dataset="|".join(sorted({re.escape(each.dataset.name) for each in CONFIGS})),
    tf="[A-Za-z][A-Za-z0-9_-]*",
    views="|".join(sorted({re.escape(each.views.name) for each in CONFIGS})),
    fit="|".join(sorted({re.escape(fit_folder(each)) for each in CONFIGS})),
    edit="|".join(sorted({re.escape(each.edit.name) for each in CONFIGS})),
