"""The edits of an experiment and what they start from; the settings and files of their jobs."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from yaml import YAMLError

from texgs.config.case import Case
from texgs.config.project import is_scene_file, members
from texgs.config.schema import Config
from texgs.core.errors import ArgumentError, ConfigError, MissingDataError
from texgs.core.names import close
from texgs.core.plain_yaml import parse_yaml
from texgs.edit.keys import EditKeys
from texgs.edit.method import NO_METHOD, method_of, methods
from texgs.scene.series_file import read_series
from texgs.workflow.inputs import models_of_scene, scene_before, view_set
from texgs.workflow.locate import tf_names

CAPTIONS = {"style": "styled", "instruction": "instructed"}  # keys of a look by what a method follows
VIEWS = "views."  # before the name of a model, in the names of inputs
OF_ONE = ("edit.name", "edit.method", "edit.base", "edit.parts")  # keys of one edit, not of its base


def edits_of(case: Case) -> list[Case]:
    """Return the edits of an experiment, each after those that it starts from."""
    config = case.config
    if repeated := [name for name in config.edits if config.edits.count(name) > 1]:
        raise ConfigError(f"edits: expected different names, got {repeated[0]} twice")
    if not config.edits and config.edit.method == NO_METHOD:
        return []
    by_name: dict[str, Case] = {}
    for each in [case.edited(name) for name in config.edits] or [case]:
        chain = chain_of(each)
        require_parts(chain)
        for one in chain:
            by_name.setdefault(one.config.edit.name, one)
    return list(by_name.values())


def chain_of(case: Case) -> list[Case]:
    """Return an edit and all that it starts from, the first one first.

    The words of the case hold for all of them, but for the name, the method, the base and the parts.
    """
    chain = [case]
    while (base := chain[0].config.edit.base) is not None and not starts_from_scene(chain[0].config):
        before = case.without(*OF_ONE).edited(base)
        if before.config.edit.name in [each.config.edit.name for each in chain]:
            raise ConfigError(f"edit.base: {base} starts from itself; choose another base")
        chain.insert(0, before)
    return chain


def starts_from_scene(config: Config) -> bool:
    """Return whether an edit starts from a scene that is there, and not from another edit of conf/edit."""
    base, known = config.edit.base, members("edit")
    if is_scene_file(base):
        return True
    if base in known:
        return False
    if scene_before(config).is_file():
        return True
    raise ConfigError(
        f"edit.base: expected the file of a scene or one of {', '.join(known)}, got {base}"
        f"{close(base, known)}"
    )


def require_parts(chain: Sequence[Case]) -> None:
    """Require of edits, each of which starts from the one before it, methods and the parts they change."""
    edits = [case.config.edit for case in chain]
    if unmade := next((edit.name for edit in edits if edit.method == NO_METHOD), None):
        raise ConfigError(
            f"edit={unmade}: expected a method, got none; write `method: NAME` into conf/edit/{unmade}.yaml, "
            f"with one of {', '.join(methods())}"
        )
    if edits[0].base is not None:  # a scene that is there, and that says so at once
        return
    try:
        models = tf_names(chain[0].config)
    except MissingDataError:  # the plan says so
        return
    known = list(models)
    for edit in edits:
        for part in edit.parts:
            if part not in known:
                hint = close(part, known)
                raise ConfigError(f"edit.parts: expected some of {', '.join(known)}, got {part}{hint}")
        known += method_of(edit).of(edit).adds(models)


def edit_keys(config: Config) -> dict[str, Any]:
    """Return what jobs of edits read of theirs: what all edits have, and the keys of the method."""
    keys = [*(field.name for field in fields(EditKeys)), config.edit.method]
    return {name: getattr(config.edit, name) for name in keys} | captions(config)


def captions(config: Config) -> dict[str, str]:
    """Return both captions of an edit: its own, or those of all basic scenes together."""
    edit, table = config.edit, config.dataset.looks
    names = list(looks_of(config))
    if not names:
        return {name: getattr(edit, name) for name in ("source_caption", "target_caption")}
    after = CAPTIONS[method_of(edit).follows]
    return {
        "source_caption": " and ".join(table[name].caption for name in names),
        "target_caption": " and ".join(getattr(table[name], after) for name in names),
    }


def looks_of(config: Config) -> dict[str, str]:
    """Return what each model of a scene follows; empty where all follow what the edit itself says."""
    edit, dataset, table = config.edit, config.dataset.name, config.dataset.looks
    if not edit.looks:
        return {}
    follows, names = method_of(edit).follows, tf_names(config)
    if not follows:
        raise ConfigError(
            f"edit.looks: expected a method that follows a picture or an instruction, got {edit.method}"
        )
    for name in names:
        if name not in table:
            raise ConfigError(
                f"dataset.looks of {dataset}: expected a look for each of {', '.join(names)}, got none for "
                f"{name}; add one, or set edit.looks=false"
            )
    return {name: getattr(table[name], follows) for name in names}


def edited_scene(config: Config) -> dict[str, Path]:
    """Return the scene that an edit starts from, its models, their training views, and files of styles."""
    if config.edit.base == config.edit.name:
        raise ConfigError(f"edit.base: {config.edit.name} starts from itself; choose another base")
    views = {f"{VIEWS}{name}": view_set(config, name)["views"] for name in tf_names(config)}
    method = method_of(config.edit)
    scene = scene_before(config)
    models = files_of_scene(scene) if is_scene_file(config.edit.base or "") else models_of_scene(config)
    looks: dict[str, str | None] = {**looks_of(config)} or {"": None}
    files = {
        f"{key}.{name}" if name else key: path
        for name, look in looks.items()
        for key, path in method.of(config.edit, look).files().items()
    }
    return {"scene": scene, **models, **views, **files}


def files_of_scene(scene: Path) -> dict[str, Path]:
    """Return the files that a scene's file names, where they are there: they decide what it shows, too."""
    try:
        named: list[object] = [parse_yaml(scene.read_text(encoding="utf-8"))]
    except (OSError, ValueError, YAMLError, ArgumentError):
        return {}  # the job tells what is wrong with it
    files, light = dict[str, Path](), named[0].get("light") if isinstance(named[0], dict) else None
    has_shadows = isinstance(light, dict) and not light.keys().isdisjoint(("shadows", "occlusion"))
    while named:
        table = named.pop()
        for key, value in table.items() if isinstance(table, dict) else ():
            if key == "volume" and not has_shadows:  # pictures of an edit need it for them alone
                continue
            if key == "series" and (path := scene.parent / str(value)).is_file():
                files |= {f"of_series.{number}": each for number, each in enumerate([path, *steps_of(path)])}
            if key in ("file", "texture") and (path := scene.parent / str(value)).is_file():
                files[f"of_scene.{len(files)}"] = path
            named.append(value)
    return files


def steps_of(series: Path) -> list[Path]:
    """Return the models of all steps of a series, as far as they are there: an edit learns from some."""
    try:
        known = read_series(series)
    except ArgumentError:
        return []  # the job tells what is wrong with it
    models = [known.model(name, step) for name in known.models for step in range(len(known.steps))]
    return [model for model in models if model.is_file()]
