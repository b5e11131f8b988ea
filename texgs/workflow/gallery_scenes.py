"""The scene that a place of a gallery shows: which recipe, edit and variant, and the parts that it has."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from texgs.config.check import is_scene_file
from texgs.config.compose import compose
from texgs.config.gallery import AS_FITTED, ShotKeys
from texgs.config.project import members
from texgs.core.errors import ConfigError
from texgs.core.names import close
from texgs.edit.method import method_of
from texgs.workflow.inputs import with_recipe
from texgs.workflow.locate import tf_names
from texgs.workflow.variants import changes as swept

if TYPE_CHECKING:
    from texgs.config.schema import Config
    from texgs.edit.keys import EditKeys

ANYWHERE = ("background", "light")  # changes of the whole scene


def fit_of(config: Config, shot: ShotKeys, where: str) -> Config:
    """The configuration of the fit whose scene is shown."""
    of_fit = with_fit(config, recipe_of(config, shot, where))
    variants = list(swept(config))
    if (shot.variant or "") not in (variants or [""]):
        expected = f"one of {', '.join(variants)}" if variants else "none without a sweep"
        hint = close(shot.variant or "", variants)
        raise ConfigError(f"{where}.variant: expected {expected}, got {shot.variant or 'none'}{hint}")
    if shot.variant:
        of_fit = replace(of_fit, variant=shot.variant)
    return of_fit


def with_fit(config: Config, name: str) -> Config:
    """The configuration with one of the recipes of an experiment, or with its only one."""
    return with_recipe(config, name) if config.fits else config


def recipe_of(config: Config, shot: ShotKeys, where: str) -> str:
    """The recipe whose scene is shown."""
    recipes = list(config.fits) or [config.fit.name]
    if shot.fit is not None and shot.fit not in recipes:
        raise ConfigError(
            f"{where}.fit: expected one of {', '.join(recipes)}, got {shot.fit}{close(shot.fit, recipes)}"
        )
    able = takers(config, str(shot.edit), where)
    if shot.fit is not None and shot.fit not in able:
        raise ConfigError(f"{where}.fit: {shot.edit} does not work on {shot.fit}; choose another recipe")
    if not able:
        raise ConfigError(f"{where}.edit: {shot.edit} works on none of {', '.join(recipes)}; add a recipe")
    return shot.fit or able[0]


def takers(config: Config, edit: str, where: str) -> list[str]:
    """The recipes of the experiment that an edit works on."""
    recipes = list(config.fits) or [config.fit.name]
    if edit == AS_FITTED:
        return recipes
    known = list(dict.fromkeys(each.name for name in config.edits for each in ancestry(name)))
    if edit not in known:
        expected = ", ".join([AS_FITTED, *known])
        raise ConfigError(f"{where}.edit: expected one of {expected}, got {edit}{close(edit, known)}")
    method = method_of(compose((f"edit={edit}",)).edit)
    return [name for name in recipes if method.takes(field_of(config, name))]


def field_of(config: Config, name: str) -> str:
    """The kind of field that one of the recipes of an experiment fits."""
    return str(compose((f"fit={name}",)).fit.field if config.fits else config.fit.field)


def ancestry(name: str) -> list[EditKeys]:
    """An edit and those that it starts from, the first one first."""
    edit = compose((f"edit={name}",)).edit
    is_first = edit.base is None or is_scene_file(edit.base) or edit.base not in members("edit")
    return [edit] if is_first else [*ancestry(edit.base), edit]


def check_changes(config: Config, shot: ShotKeys, where: str) -> None:
    """Require of changes that the parts are there which they change."""
    models = tf_names(config)
    parts = list(models)
    for edit in ancestry(shot.edit) if shot.edit not in (None, AS_FITTED) else ():
        parts += method_of(edit).adds(method_of(edit).of(edit), models)
    for change in shot.changes:
        name, is_change, _ = change.partition("=")
        part = name.rpartition(".")[0] or name
        if not is_change or part not in (*parts, *ANYWHERE):
            raise ConfigError(
                f"{where}.changes: expected PART.KEY=VALUE with one of {', '.join(parts)}, got "
                f"{change}{close(part, parts)}"
            )
