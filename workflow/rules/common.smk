# Configuration, data sets with their basic TFs, and what the command lines of all jobs share.
import re
import shlex
import sys
from importlib.resources import files
from pathlib import Path

from texgs.cli.stages.tf import check_basic_tfs
from texgs.config.code import code_digest, digest
from texgs.config.compose import compose
from texgs.config.locate import tf_names
from texgs.config.stage import STAGES, fit_folder, for_tf, settings_file
from texgs.config.sweep import variants
from texgs.core.errors import ConfigError, TexgsError

GROUPS = ("experiment", "dataset", "views", "fit", "sweep", "device", "tracking")


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


def configurations(words):
    """One for each data set and variant of the sweep."""
    names = compose(words).datasets
    found, known = [], set()
    for each in [(*words, f"dataset={name}") for name in names] or [words]:
        base = compose(each)
        check_basic_tfs(base.dataset)
        if base.dataset.name in known:
            raise ConfigError(f"datasets: expected different names, got {base.dataset.name} twice")
        known.add(base.dataset.name)
        found += [compose(variant) for variant in variants(each)]
    return found


def jobs(configs):
    """Settings file and input files of each job, by stage and folder; those of each basic TF apart."""
    found = {}
    for config in configs:
        by_tf = [for_tf(config, name) for name in tf_names(config)]
        for name, stage in STAGES.items():
            for each in (by_tf if stage.per_tf else [config]) if stage.applies(config) else ():
                job = settings_file(stage, each), stage.inputs(each)
                if found.setdefault((name, stage.output(each).as_posix()), job) != job:
                    raise ConfigError(f"{stage.output(each)}: two variants go there; give one another name")
    return found


def job(stage, wildcards):
    """Settings file and input files of the job that wildcards describe."""
    folder = Path(RESULTS, STAGES[stage].folder.format(**dict(wildcards.items())))
    return JOBS[stage, folder.as_posix()]


def settings(stage, wildcards):
    """The file with the settings of a job: its name is the digest of its contents."""
    return job(stage, wildcards)[0]


def inputs(stage, wildcards):
    """The files a job reads."""
    return {name: path.as_posix() for name, path in job(stage, wildcards)[1].items()}


def done(*stages):
    """The metrics files of all jobs of some stages."""
    return sorted(f"{folder}/metrics.json" for stage, folder in JOBS if stage in stages)


# A mistake of the user ends here in one sentence, before any job.
try:
    WORDS = overrides()
    CONFIG = compose(WORDS)
    CONFIGS = configurations(WORDS)
    RESULTS = CONFIG.results
    JOBS = jobs(CONFIGS)
except TexgsError as error:
    print(f"texgs: {error}", file=sys.stderr)
    sys.exit(2)

STORE = CONFIG.tracking.uri
GPU = int(CONFIG.device.mapper == "gpu")  # a volume mapper's

# In front of the commands, not a parameter of the rules: where runs are recorded changes no result.
ENVIRONMENT = (
    {} if STORE is None else {"TEXGS_TRACKING": STORE, "TEXGS_EXPERIMENT": CONFIG.tracking.experiment}
)
SETTING = " ".join(f"{name}={shlex.quote(value)}" for name, value in ENVIRONMENT.items())
shell.prefix(
    "set -euo pipefail; "
    f'texgs() {{{{ {SETTING} {shlex.quote(sys.executable)} -P -m texgs.cli.main "$@"; }}}}; '
)


pathvars:
    results=RESULTS,
    logs=f"{RESULTS}/logs",
    benchmarks=f"{RESULTS}/benchmarks",


wildcard_constraints:
    dataset="|".join(sorted({re.escape(each.dataset.name) for each in CONFIGS})),
    tf="|".join(sorted({re.escape(name) for each in CONFIGS for name in tf_names(each)})),
    views="|".join(sorted({re.escape(each.views.name) for each in CONFIGS})),
    fit="|".join(sorted({re.escape(fit_folder(each)) for each in CONFIGS})),
