"""Sweeps: the variants of an experiment, as more words for `compose`."""

from collections.abc import Sequence
from dataclasses import fields
from itertools import product

from texgs.config.compose import compose
from texgs.config.describe import value_at
from texgs.config.schema import Config
from texgs.core.errors import ConfigError
from texgs.edit.keys import EditKeys
from texgs.edit.method import NO_METHOD
from texgs.workflow.product import SEEDS, key_of
from texgs.workflow.variants import OF_EDITS, OF_FITS, changes, changes_edits, group_of, is_of_edits, own_name

SWEPT = (*OF_FITS, OF_EDITS)
ELSEWHERE = {  # keys whose values have a list of their own
    **{key: f"sweep.{listed}" for key, listed in SEEDS.items()},
    "edit": "edits=[...]",
    "edit.name": "edits=[...]",
}


def variants(words: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The words of each variant of the sweep with each seed; the given ones, where there is none.

    Variants that change the views have a folder of their own for them, unless they name one.
    """
    config = compose(words)
    by_variant, sweep = changes(config), config.sweep
    if not by_variant:
        return [words]
    for name, listed in by_variant.items():
        check_variant(name, listed)
    check_seeds(config)
    words = (*words, *edits_of_sweep(config))
    if is_of_edits(config):
        check_edits(words)
    return [
        (
            *(*words, *listed, *own_views(config, name)),
            *(f"variant='{name}'", f"fit.seed={seed}", f"edit.seed={edit_seed}"),
        )
        for name, listed in by_variant.items()
        for seed, edit_seed in product(sweep.seeds, sweep.edit_seeds)
    ]


def own_views(config: Config, name: str) -> tuple[str, ...]:
    """The word that gives a variant a folder for its views, where it changes them and names none."""
    own = own_name(config, name, ("views",))
    is_named = "views.name" in map(key_of, changes(config)[name])
    return (f"views.name=views-{own.replace('.', '_')}",) if own and not is_named else ()


def check_variant(name: str, listed: Sequence[str]) -> None:
    """Require of a variant that it changes what may differ between variants."""
    if not name:
        raise ConfigError("sweep.variants: expected a name for each variant, got an empty one")
    for change in listed:
        key = key_of(change)
        if group_of(change) not in SWEPT:
            raise ConfigError(
                f"sweep.variants.{name}: expected overrides of views, fit, device or edit, got {change}; "
                "the rest is the same for all variants, and several data sets go to datasets=[...]"
            )
        if key in ELSEWHERE:
            raise ConfigError(f"sweep.variants.{name}: got {change}, whose values go to {ELSEWHERE[key]}")


def check_seeds(config: Config) -> None:
    """Require seeds, each once, and none that would not count."""
    for key, listed in SEEDS.items():
        seeds, own = getattr(config.sweep, listed), value_at(config, key)
        if not seeds:
            raise ConfigError(f"sweep.{listed}: expected at least one, got none")
        if repeated := [seed for seed in seeds if seeds.count(seed) > 1]:
            raise ConfigError(f"sweep.{listed}: expected different seeds, got {repeated[0]} twice")
        if own and own not in seeds:
            raise ConfigError(f"{key}: expected seeds of a sweep in sweep.{listed}, got {key}={own}")


def edits_of_sweep(config: Config) -> tuple[str, ...]:
    """The word with the edits of the sweep, where the experiment has none of its own."""
    if config.edits or config.edit.method != NO_METHOD:
        return ()
    if is_of_edits(config) and not config.sweep.edits:
        raise ConfigError(
            f"sweep {config.sweep.name}: expected an edit that its variants change, got none; "
            "choose one, such as edit=style"
        )
    return (f"edits=[{','.join(config.sweep.edits)}]",) if config.sweep.edits else ()


def check_edits(words: tuple[str, ...]) -> None:
    """Require of each edit of a sweep of edits alone that its variants differ."""
    config = compose(words)
    listed = [change for each in changes(config).values() for change in each]
    if len(config.sweep.edit_seeds) > 1 or not all(map(changes_edits, listed)):
        return
    tables = {key_of(change).split(".")[1] for change in listed}
    for edit in [compose((*words, f"edit={name}")).edit for name in config.edits] or [config.edit]:
        if not tables & {edit.method, *(field.name for field in fields(EditKeys))}:
            raise ConfigError(
                f"sweep {config.sweep.name}: expected to change edit {edit.name}, whose keys are "
                f"edit.{edit.method}, got {', '.join(sorted({key_of(change) for change in listed}))}; "
                "leave out that edit"
            )
