"""What the variants of a sweep change: their fits, or only the edits of fits that they share."""

from collections.abc import Mapping, Sequence

from texgs.config.describe import value_at
from texgs.config.schema import NO_SWEEP, Config
from texgs.core.errors import ConfigError
from texgs.workflow.product import ONLY_SEEDS, SEEDS, combinations, key_of, label

OF_FITS = ("views", "fit", "device")  # groups of keys that change fits
OF_EDITS = "edit"


def changes(config: Config) -> Mapping[str, tuple[str, ...]]:
    """The overrides of each variant of the sweep, by name; none without a sweep."""
    sweep = config.sweep
    if sweep.over and sweep.variants:
        raise ConfigError("sweep.over: expected none beside sweep.variants; leave out one of the two")
    given = {name: tuple(each) for name, each in sweep.variants.items()} or (
        combinations(tuple(sweep.over)) if sweep.over else {}
    )
    if sweep.name == NO_SWEEP:
        if given:
            raise ConfigError("sweep.name: expected a name for the table of the variants, got none")
        return {}
    if not given and all(len(getattr(sweep, listed)) < 2 for listed in SEEDS.values()):
        raise ConfigError(
            f"sweep {sweep.name}: expected variants, keys to sweep over or several seeds, got none of them"
        )
    return given or {ONLY_SEEDS: ()}


def is_of_edits(config: Config) -> bool:
    """Whether the variants of the sweep have edits that differ."""
    variants = changes(config)
    named = any(changes_edits(change) for listed in variants.values() for change in listed)
    return bool(variants) and (named or len(config.sweep.edit_seeds) > 1)


def changes_edits(change: str) -> bool:
    """Whether an override is of the keys of edits."""
    return group_of(change) == OF_EDITS


def fit_variant(config: Config) -> str:
    """What the variant is called by its fits; empty for fits that all variants of edits share."""
    if not is_of_edits(config):
        return str(config.variant)
    return own_name(config, config.variant, OF_FITS)


def own_name(config: Config, variant: str, groups: Sequence[str]) -> str:
    """Name of what the overrides of some groups make of a variant; empty where it has none of these.

    In a sweep over keys it is that of their values, so that all variants with the same ones share it.
    """
    own = [change for change in changes(config).get(variant, ()) if group_of(change) in groups]
    if not own or not config.sweep.over:
        return variant if own else ""
    return "-".join(label(change.partition("=")[2]) for change in own)


def edit_variant(config: Config) -> str:
    """The variant that an edit is of; empty where all variants have the same edits, of different fits."""
    return str(config.variant) if is_of_edits(config) else ""


def swept(config: Config) -> dict[str, str]:
    """What makes a configuration another one than the rest of its sweep: values as text, by their keys."""
    listed = changes(config).get(config.variant, ())
    texts = {key_of(change): change.partition("=")[2] for change in listed}
    values = {key: value_at(config, key) if "." in key else text for key, text in texts.items()}
    for key, seeds in SEEDS.items():
        if len(getattr(config.sweep, seeds)) > 1:
            values[key] = value_at(config, key)
    return {key: str(value) for key, value in values.items()}


def group_of(change: str) -> str:
    """The group that an override is of."""
    return key_of(change).partition(".")[0]
