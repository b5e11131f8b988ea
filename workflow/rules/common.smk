# Configuration, data sets with their basic TFs, and what the command lines of all jobs share.
import re
import shlex
import sys

from texgs.cli.stages.tf import check_basic_tfs
from texgs.config.code import code_digest
from texgs.config.compose import compose
from texgs.config.locate import tf_names
from texgs.config.stage import STAGES, settings_file
from texgs.core.errors import ConfigError, TexgsError

GROUPS = ("experiment", "dataset", "views", "fit", "device", "tracking")


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


def data_sets(words):
    """Configurations by data set and basic TF; the one of the data set itself has the name None."""
    names = compose(words).datasets
    chosen = [(*words, f"dataset={name}") for name in names] or [words]
    found = {}
    for each in chosen:
        base = compose(each)
        check_basic_tfs(base.dataset)
        tfs = {name: compose((*each, f"tf={name}")) for name in tf_names(base)}
        starts_from_views = base.dataset.views_folder is not None
        for each_config in tfs.values() if starts_from_views else [base]:
            STAGES["sheet" if starts_from_views else "volume"].inputs(each_config)  # the data are there
        if base.dataset.name in found:
            raise ConfigError(f"datasets: expected different names, got {base.dataset.name} twice")
        found[base.dataset.name] = {None: base, **tfs}
    return found


def settings(stage, wildcards):
    """The file with the settings of a job: its name is the digest of its contents."""
    return SETTINGS[stage, wildcards.dataset, getattr(wildcards, "tf", None)]


def inputs(stage, wildcards):
    """The files a job reads."""
    config = DATA_SETS[wildcards.dataset][getattr(wildcards, "tf", None)]
    return {name: path.as_posix() for name, path in STAGES[stage].inputs(config).items()}


# A mistake of the user ends here in one sentence, before any job.
try:
    WORDS = overrides()
    CONFIG = compose(WORDS)
    DATA_SETS = data_sets(WORDS)
    SETTINGS = {
        (name, dataset, tf): settings_file(stage, config)
        for name, stage in STAGES.items()
        for dataset, configs in DATA_SETS.items()
        for tf, config in configs.items()
        if stage.per_tf == (tf is not None) and stage.applies(config)
    }
except TexgsError as error:
    print(f"texgs: {error}", file=sys.stderr)
    sys.exit(2)

RESULTS = CONFIG.results
STORE = CONFIG.tracking.uri
GPU = int(CONFIG.device.mapper == "gpu")  # a volume mapper's
VOLUMES = [name for name, configs in DATA_SETS.items() if configs[None].dataset.views_folder is None]

# In front of the commands, not a parameter of the rules: where runs are recorded changes no result.
ENVIRONMENT = (
    {} if STORE is None else {"TEXGS_TRACKING": STORE, "TEXGS_EXPERIMENT": CONFIG.tracking.experiment}
)
SETTING = " ".join(f"{name}={shlex.quote(value)}" for name, value in ENVIRONMENT.items())
shell.prefix(
    "set -euo pipefail; "
    f'texgs() {{{{ {SETTING} {shlex.quote(sys.executable)} -P -m texgs.cli.main "$@"; }}}}; '
)


# Data sets and their basic TFs, as wildcards of the rules that make a job for each.
PAIRS = [(dataset, tf) for dataset, tfs in DATA_SETS.items() for tf in tfs if tf]


pathvars:
    results=RESULTS,
    logs=f"{RESULTS}/logs",
    benchmarks=f"{RESULTS}/benchmarks",


wildcard_constraints:
    fit=re.escape(CONFIG.fit.name),
    dataset="|".join(map(re.escape, DATA_SETS)),
    tf="|".join(sorted({re.escape(tf) for tfs in DATA_SETS.values() for tf in tfs if tf})),
