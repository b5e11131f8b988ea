"""The verbs of the stages: by hand with key=value, or as one job that Snakemake started."""

import argparse
from dataclasses import replace
from pathlib import Path

from texgs.config.case import Case
from texgs.config.compose import compose
from texgs.core.cache import Checksums
from texgs.core.errors import ArgumentError
from texgs.workflow.checks import check_basic_tfs, require_edit, require_fit, require_fits
from texgs.workflow.execution import Task, makers, perform, with_makers
from texgs.workflow.job import Job
from texgs.workflow.locate import tf_names
from texgs.workflow.stage_table import STAGES


class HelpWithKeys(argparse.Action):
    """List every key of the configuration below the help; read only now, because it takes a moment."""

    def __call__(self, parser: argparse.ArgumentParser, *_rest: object) -> None:
        """Print the help and exit."""
        from texgs.config.describe import describe
        from texgs.config.project import groups

        parser.print_help()
        print(f"\ngroups, each a folder of conf/:\n{groups()}")
        print(f"\nkeys, with their defaults:\n{describe(compose())}")
        parser.exit()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add overrides of the configuration, and the files of one job."""
    parser.add_argument("-h", "--help", action=HelpWithKeys, nargs=0, help="show this, and all keys")
    parser.add_argument(
        "overrides", nargs="*", metavar="KEY=VALUE", help="such as dataset=engine tf=TF01 views.width=400"
    )
    parser.add_argument("--force", action="store_true", help="do it again, even if nothing has changed")
    parser.add_argument("--replace", action="store_true", help="replace results of other settings")
    job = parser.add_argument_group(
        "one job, as the workflow runs it (no KEY=VALUE then)",
        "TEXGS_TRACKING and TEXGS_EXPERIMENT say where the run is recorded; by default it is not.",
    )
    job.add_argument(
        "--settings", type=Path, metavar="FILE", help="what the stage reads, a file in results/.conf"
    )
    job.add_argument("--input", nargs="*", default=[], metavar="NAME=FILE", help="files the stage reads")
    job.add_argument("--output", type=Path, metavar="FOLDER", help="where its files go")


def run(arguments: argparse.Namespace) -> int:
    """Run the stage that the verb names."""
    if arguments.settings is not None:
        return run_settings(arguments)
    if arguments.input or arguments.output is not None:
        raise ArgumentError(
            "--input, --output: expected only with --settings, as the workflow runs a job; by hand, "
            "results=FOLDER says where results go"
        )
    case, stage = Case(tuple(arguments.overrides)), STAGES[arguments.verb]
    config = case.config
    check_basic_tfs(config.dataset)
    require_fit(stage, config)
    if stage.place == "edit" or stage.name == "edit_metrics":
        require_edit(stage, case)
    if stage.name == "comparison":
        require_fits(case)
    known = makers(case)
    configs = [replace(config, tf=name) for name in tf_names(config)] if stage.per_tf else [config]
    tasks = [task for each in configs for task in with_makers(Task(stage, each, case.words), known)]
    checksums = Checksums.load()
    for task in () if arguments.replace else tasks:
        task.job(checksums).require_same_settings(config.results)
    for task in tasks:
        perform(task, force=arguments.force and task.stage is stage)
    return 0


def run_settings(arguments: argparse.Namespace) -> int:
    """Run one job from the file of its settings."""
    import yaml

    from texgs.workflow.execution import execute
    from texgs.workflow.tracked import of_workflow

    if arguments.overrides or arguments.force or arguments.replace or arguments.output is None:
        raise ArgumentError("a job: expected --settings and --output, nothing but --input beside; see --help")
    try:
        settings = yaml.load(arguments.settings.read_bytes(), yaml.CSafeLoader)
    except (OSError, yaml.YAMLError) as error:
        raise ArgumentError(f"{arguments.settings}: expected the settings of a job ({error})") from error
    if not isinstance(settings, dict) or settings.get("stage") != arguments.verb:
        raise ArgumentError(
            f"{arguments.settings}: expected the settings of a {arguments.verb} job, got others"
        )
    inputs = {name: Path(path) for name, _, path in (word.partition("=") for word in arguments.input)}
    tracking, swept, command = of_workflow(arguments.output)
    stage, plain = STAGES[arguments.verb], {str(key): value for key, value in settings.items()}
    execute(Job(stage, plain, inputs, arguments.output, swept=swept, command=command), tracking)
    return 0
