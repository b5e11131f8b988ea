"""Mistakes in the choice of a fit or an edit, told before any job runs and any earlier result goes."""

import shlex
from collections.abc import Callable

from texgs.config.case import Case
from texgs.config.dataset import Dataset
from texgs.config.project import members
from texgs.config.schema import Config
from texgs.core.errors import ConfigError, MissingDataError, errors_at
from texgs.edit.method import NO_METHOD, method_of, methods
from texgs.fields.kinds import Kind, kinds, require
from texgs.fields.surfels.material import require_material
from texgs.fitting.kinds import fit_specs
from texgs.volume.basic_tfs import MAX_CHANNELS, function_of
from texgs.workflow.edits import OF_ONE, chain_of, looks_of, require_parts
from texgs.workflow.inputs import scene_before
from texgs.workflow.stage import Stage

ABLE: dict[str, Callable[[Kind], bool]] = {  # kinds of field that a stage works on; others work on all
    "mesh": lambda kind: bool(kind.depth),
    "page": lambda kind: "html" in kind.exports,
    "steps": lambda kind: kind.name == "surfels",
}


def check_fit(config: Config) -> None:
    """Require settings of the fit that fit each other, and a device that its field is fitted on."""
    fit, kind = config.fit, fit_specs()[config.fit.field]
    if config.device.name not in kind.devices:
        raise ConfigError(
            f"device: expected {' or '.join(sorted(kind.devices))} for fit={fit.name}, "
            f"which fits {fit.field}, got {config.device.name}; choose another device or fit"
        )
    if kind.settings is None:
        require_material(vars(fit.first_material), fit.material_range)
    else:
        kind.check(getattr(fit, kind.name))


def check_edit(config: Config) -> None:
    """Require of an edit all that can be told without its scene and without weights."""
    if config.edit.method != NO_METHOD:
        if config.tf is not None:
            raise ConfigError(f"tf: an edit is of a scene, with all basic TFs; leave out tf={config.tf}")
        method = method_of(config.edit)
        require(config.fit.field, method.needs, f"edit {config.edit.name}", method.fields)
        for look in looks_of(config).values() or [None]:
            method.of(config.edit, look).check()
        method.of(config.edit).check_fit(config.fit)


def check_basic_tfs(dataset: Dataset) -> None:
    """Check the points of all basic TFs of a data set, and that their ranges do not overlap."""
    from texgs.volume.transfer import check_disjoint

    check_channels(dataset)
    basic = {}
    for name, points in dataset.basic_tfs.items():
        with errors_at(f"{dataset.name}: basic TF {name}"):
            basic[name] = function_of(points, dataset.prepared)
    with errors_at(f"{dataset.name}: basic TFs", " "):
        check_disjoint(basic)


def check_channels(dataset: Dataset) -> None:
    """Require that all basic TFs of a data set name channels of its file, or none; a series has one."""
    check_labels(dataset)
    channels = dataset.channels
    images = {name: points for name, points in dataset.basic_tfs.items() if points.label is None}
    unnamed = [name for name, points in images.items() if points.channel is None]
    if channels and unnamed:
        raise ConfigError(
            f"{dataset.name}: basic TF {unnamed[0]}: expected a channel, as others name theirs "
            f"({', '.join(channels)}), got none"
        )
    if channels and dataset.volume.channel is not None:
        raise ConfigError(
            f"dataset.volume.channel: expected none, as basic TFs of {dataset.name} name channels "
            f"({', '.join(channels)}), got {dataset.volume.channel}"
        )
    if channels and dataset.series:
        raise ConfigError(
            f"dataset.series of {dataset.name}: expected one channel, got {', '.join(channels)}; name it by "
            "dataset.volume.channel, or leave out the series"
        )
    if channels and dataset.volume.generator:
        raise ConfigError(
            f"{dataset.name}: basic TFs: expected none that name channels, as the volume is generated, got "
            f"{', '.join(channels)}; leave these out"
        )


def check_labels(dataset: Dataset) -> None:
    """Require that basic TFs name labels where the data set has some, and of labels alone all of them."""
    volume, where = dataset.volume, f"{dataset.name}: basic TF"
    if volume.kind == "labels" and volume.labels:
        raise ConfigError(
            f"dataset.volume.labels of {dataset.name}: expected none, as its file holds labels itself "
            "(kind=labels); leave one of them out"
        )
    for name, points in dataset.basic_tfs.items():
        if points.label is not None and points.channel is not None:
            raise ConfigError(f"{where} {name}: expected a channel or a label, got both; leave one out")
        if volume.kind == "labels" and points.label is None:
            raise ConfigError(f"{where} {name}: expected a label, as the volume holds labels, got none")
        if volume.kind == "image" and not volume.labels and (points.label or points.within) is not None:
            raise ConfigError(
                f"{where} {name}: expected no label, as dataset.volume.labels names no file of labels"
            )
    if dataset.labels and dataset.series:
        raise ConfigError(f"dataset.series of {dataset.name}: expected no labels in a series; leave them out")
    if len(dataset.prepared) > MAX_CHANNELS:
        raise ConfigError(
            f"{dataset.name}: basic TFs: expected at most {MAX_CHANNELS} channels and labels together, got "
            f"{len(dataset.prepared)}; leave some out"
        )


def require_fit(stage: Stage, config: Config) -> None:
    """Require a fit that a verb can work on: of its field, and with a surface for meshes."""
    if "{fit}" not in stage.rule.folder:
        return  # stages before the fits work with any
    fit, kind = config.fit, fit_specs()[config.fit.field]
    if stage.place == "phase" and stage.name not in kind.phases:
        owner = next(other.name for other in fit_specs().values() if stage.name in other.phases)
        raise ConfigError(
            f"fit.field: texgs {stage.name} fits {owner}, but fit={fit.name} has field {kind.name}; "
            f"run texgs {kind.phases[-1]} or choose another fit"
        )
    able = [other.name for other in kinds().values() if ABLE.get(stage.name, bool)(other)]
    if kind.name not in able:
        raise ConfigError(
            f"fit.field: texgs {stage.name} expects a fit of {' or '.join(able)}, but fit={fit.name} has "
            f"field {kind.name}; choose another fit"
        )
    if stage.name == "steps" and not config.dataset.series and config.dataset.volume.steps < 2:
        raise ConfigError(
            f"dataset.series of {config.dataset.name}: expected the steps of a series in time, got none; "
            "choose another data set, such as dataset=rings"
        )
    check_fit(config)


def require_fits(case: Case) -> None:
    """Require several recipes, each without mistakes."""
    recipes = case.config.fits
    if len(recipes) < 2:
        raise ConfigError("fits: expected several recipes to compare, such as fits=[quick,demo]")
    for recipe in recipes:
        check_fit(case.but(f"fit={recipe}").config)


def require_edit(stage: Stage, case: Case) -> None:
    """Require that the edit is one for this verb, and that what it starts from is there with its parts."""
    config = case.config
    own = [name for name, method in methods().items() if method.stage == stage.name]
    expected = own or [name for name, method in methods().items() if method.is_look]
    if config.edit.method not in expected:
        raise ConfigError(
            f"edit.method: expected {' or '.join(expected)}, got {config.edit.method} "
            f"(edit={config.edit.name}); choose another edit of conf/edit"
        )
    check_edit(config)
    is_there = scene_before(config).is_file()
    if config.edit.base in members("edit") and is_there:
        return  # it may have been made with other words than those of conf/edit: the parts it has count
    chain = chain_of(case)
    require_parts(chain)
    if config.edit.base is not None and not is_there:
        before = chain[-2].config.edit
        same = shlex.join(case.without("edit", *OF_ONE).words)
        raise MissingDataError(
            f"edit.base: {before.name} is not done yet; run texgs {method_of(before).stage} {same} "
            f"edit={before.name} first"
        )
