"""A stage by hand: the jobs that it needs run before it, in this process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from texgs.config.compose import compose
from texgs.config.schema import Config
from texgs.core.checksum import Checksums
from texgs.edit.method import NO_METHOD
from texgs.workflow.job import Job
from texgs.workflow.locate import cached_volume, source_file
from texgs.workflow.missing import needed
from texgs.workflow.stage import Stage
from texgs.workflow.stage_table import jobs


def fetch_volume(config: Config) -> None:
    """Download the volume's file, where it is not on this machine."""
    from texgs.volume.download import download

    volume, path = config.dataset.volume, source_file(config)
    if path is not None and volume.url and path == cached_volume(volume) and not path.exists():
        download(volume.url, str(volume.sha256), path)


def makers(words: tuple[str, ...]) -> dict[Path, tuple[Stage, Config]]:
    """Return the jobs that can make what a stage reads, by their folders."""
    config = compose(words)
    fits = [(*words, f"fit={recipe}") for recipe in config.fits] or [words]
    configs = [compose((*each, "edit=none")) for each in fits]
    configs += [config] if config.edit.method != NO_METHOD else []
    return {stage.output(each): (stage, each) for config in configs for stage, each in jobs(config)}


def ensure(
    stage: Stage,
    config: Config,
    known: dict[Path, tuple[Stage, Config]] | None = None,
    *,
    force: bool = False,
    tell: Callable[[str], None] = print,
) -> None:
    """Run a stage, and before it the jobs whose files it reads, unless their results are there already.

    Args:
        stage: to run.
        config: of it.
        known: those jobs by their folders, of which those that were run are taken out.
        force: run the stage itself in any case.
        tell: gets a line for each job.
    """
    from texgs.models.weights import locate
    from texgs.workflow.execution import execute
    from texgs.workflow.tracked import Tracking

    if stage.name == "volume":
        fetch_volume(config)
    known = {} if known is None else known
    known.pop(stage.output(config), None)
    for path in stage.inputs(config).values():
        if path.parent in known:
            ensure(*known[path.parent], known, tell=tell)
    checksums = Checksums.load()
    job = Job.of(stage, config, checksums)
    if stage.place == "edit" and (force or not job.is_done()):
        for name in needed(config.edit):
            locate(name)
        job = Job.of(stage, config, checksums)  # with what was downloaded
    has_run = execute(job, Tracking(config.tracking.uri, config.tracking.experiment), force=force)
    checksums.save()
    tell(f"{job.output}: {'done' if has_run else 'up to date'}")
