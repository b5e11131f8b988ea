# Configuration, data sets with their basic TFs, and what the command lines of all jobs share.
import os
import re
import shlex
import sys
from importlib.resources import files
from pathlib import Path

from texgs.cli.stages.tf import check_basic_tfs
from texgs.config.code import ROOT, code_digest, digest
from texgs.config.compose import FOLDER, compose
from texgs.config.edits import edits
from texgs.config.kept import fingerprint, keep, recall
from texgs.config.locate import cached_volume, tf_names
from texgs.config.stage import EDITS, FOLDERS, fit_folder, for_tf, settings_file
from texgs.config.stages import STAGES
from texgs.config.sweep import variants
from texgs.core.errors import ConfigError, MissingDataError, TexgsError
from texgs.core.folders import cache_folder

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
    """Settings file and input files of each job, by stage and folder; and what is missing for some."""
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
                    files = stage.inputs(each)
                except MissingDataError as error:
                    missing.append(str(error))
                    files = {}
                made = settings_file(stage, each), files
                if found.setdefault((name, stage.output(each).as_posix()), made) != made:
                    raise ConfigError(f"{stage.output(each)}: two variants go there; give one another name")
    return found, list(dict.fromkeys(missing))


def job(stage, wildcards):
    """Settings file and input files of the job that wildcards describe."""
    folder = Path(RESULTS, FOLDERS[stage].format(**dict(wildcards.items())))
    return JOBS[stage, folder.as_posix()]


def settings(stage, wildcards):
    """The file with the settings of a job: its name is the digest of its contents."""
    return job(stage, wildcards)[0]


def inputs(stage, wildcards):
    """The files a job reads."""
    return {name: path.as_posix() for name, path in job(stage, wildcards)[1].items()}


def done(*stages, sweep=None):
    """The metrics files of all jobs of some stages, of a sweep or of none."""
    return sorted(f"{folder}/metrics.json" for stage, folder in OF_SWEEP.get(sweep, ()) if stage in stages)


def edits_of(kind):
    """The wildcard's values: names of edits of a kind."""
    return any_of(PLAN["edit"].get(kind, ()), "no-edit")


def missing_weights(configs):
    """What edits need and this machine has not; without a dry run what can be had is downloaded now.

    Mistakes in edits are told before anything is downloaded.
    """
    edited = [config for config in configs if config.edit.kind != "none"]
    if not edited:
        return []
    from texgs.cli.edits import check_edit  # not at the top: most runs have no edits
    from texgs.cli.weights import missing

    for config in edited:
        check_edit(config)
    return list(dict.fromkeys(line for config in edited for line in missing(config, download=not IS_DRY)))


def downloads(configs):
    """Address and checksum of the volumes that are not in the data folder, by the files they are downloaded to."""
    found = {}
    for config in configs:
        volume = config.dataset.volume
        if volume.url and not Path(config.data_folder, volume.file).exists():
            found[cached_volume(volume).as_posix()] = [volume.url, volume.sha256]
    return found


def plain(jobs):
    """Jobs as lists of names."""
    return [
        [stage, folder, settings, {name: path.as_posix() for name, path in files.items()}]
        for (stage, folder), (settings, files) in jobs.items()
    ]


def restored(lists):
    """The jobs that such lists name."""
    return {
        (stage, folder): (settings, {name: Path(path) for name, path in files.items()})
        for stage, folder, settings, files in lists
    }


def plan():
    """All that the rules read of the configuration, in plain values; and what is missing for some jobs."""
    config = compose(WORDS)
    by_sweep = experiments(WORDS)
    configs = [each for found in by_sweep.values() for each in found]
    found, missing = jobs(configs)
    kinds = {each.edit.kind for each in configs}
    return {
        "results": config.results,
        "tracking": [config.tracking.uri, config.tracking.experiment],
        "gpu": [int(config.device.mapper == "gpu"), int(config.device.name == "cuda")],
        "jobs": plain(found),
        "sweeps": [[sweep, list(jobs(each)[0])] for sweep, each in by_sweep.items()],
        "downloads": downloads(configs),
        "dataset": sorted({each.dataset.name for each in configs}),
        "views": sorted({each.views.name for each in configs}),
        "fit": sorted({fit_folder(each) for each in configs}),
        "edit": {kind: sorted({e.edit.name for e in configs if e.edit.kind == kind}) for kind in kinds},
    }, missing + missing_weights(configs)


def planned():
    """The plan of this run, and what is missing. A job on a cluster finds the plan that it was submitted by."""
    kept = Path(".snakemake", "texgs", f"plan-{digest(repr(WORDS))}.json")
    data = os.environ.get("TEXGS_DATA", "")
    key = digest("\n".join([*WORDS, data, fingerprint(ROOT / "texgs"), fingerprint(FOLDER)]))
    if not workflow.is_main_process and (found := recall(kept, key)):
        return found, []
    found, missing = plan()
    keep(kept, key, found)
    return found, missing


def any_of(names, otherwise="none"):
    """A wildcard's values."""
    return "|".join(map(re.escape, names)) or otherwise


IS_DRY = any(re.fullmatch(r"--dry-?run|--lint|-[a-zA-Z]*n[a-zA-Z]*", word) for word in sys.argv)

# A mistake of the user ends here in one sentence, before any job.
try:
    WORDS = overrides()
    PLAN, MISSING = planned()
except TexgsError as error:
    print(f"texgs: {error}", file=sys.stderr)
    sys.exit(2)

RESULTS, CACHE = PLAN["results"], (cache_folder() / "volumes").as_posix()
JOBS = restored(PLAN["jobs"])
OF_SWEEP = {sweep: {tuple(each) for each in folders} for sweep, folders in PLAN["sweeps"]}

# Missing files are told together and before any job; a dry run shows what would be done with them.
if MISSING:
    print("\n".join(f"texgs: {line}" for line in MISSING), file=sys.stderr)
    if not IS_DRY:
        sys.exit(2)

STORE, EXPERIMENT = PLAN["tracking"]
MAPPER_GPU, FIT_GPU = PLAN["gpu"]

# In front of the commands, not a parameter of the rules: where runs are recorded and how threads wait changes no
# result. Threads that spin while they wait take the cores that other jobs and the other threads need.
ENVIRONMENT = {"OMP_WAIT_POLICY": os.environ.get("OMP_WAIT_POLICY", "passive")}
if STORE is not None:
    ENVIRONMENT |= {"TEXGS_TRACKING": STORE, "TEXGS_EXPERIMENT": EXPERIMENT}
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
    sweep=any_of(filter(None, OF_SWEEP), "no-sweep"),
    dataset=any_of(PLAN["dataset"]),
    tf="[A-Za-z][A-Za-z0-9_-]*",
    views=any_of(PLAN["views"]),
    fit=any_of(PLAN["fit"]),
    edit=any_of(sorted({name for names in PLAN["edit"].values() for name in names})),
