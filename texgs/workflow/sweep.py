"""Sweeps: the variants of an experiment, and what each of them changes.

A sweep is a file of conf/sweep, or made of keys with several values in Hydra's syntax: `fit.low_pass=2,6`,
`views.train.frequency=range(2,6)`.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import lru_cache
from itertools import product

from texgs.config.case import Case
from texgs.config.describe import value_at
from texgs.config.project import Words
from texgs.config.schema import NO_SWEEP, ONLY_SEEDS, Config
from texgs.core.errors import ConfigError
from texgs.edit.keys import EditKeys
from texgs.edit.method import NO_METHOD

FIT_GROUPS = ("views", "fit", "device")  # groups of keys that change fits
EDIT_GROUP = "edit"
SEED_LISTS = {
    "fit.seed": "seeds",
    "edit.seed": "edit_seeds",
}  # lists in `sweep` with values of keys
OF_NUMBERS, OF_KINDS = "views", "kinds_of_views"  # the paper's sweep over numbers, and views=ONE,OTHER
ELSEWHERE = {  # keys whose values have a list of their own
    **{key: f"sweep.{listed}" for key, listed in SEED_LISTS.items()},
    **dict.fromkeys(("edit", "edit.name", "edits"), "edits=[...]"),
    **dict.fromkeys(("dataset", "datasets"), "datasets=[...]"),
    **{key: f"{key}=[...]" for key in ("fits", "experiments", "sweep.seeds", "sweep.edit_seeds")},
}


def key_of(word: str) -> str:
    """Return the key or group that an override changes."""
    return word.partition("=")[0].lstrip("+")


def group_of(word: str) -> str:
    """Return the group that an override is of."""
    return key_of(word).partition(".")[0]


def label(value: str) -> str:
    """Return a value as part of the name of a variant."""
    text = re.sub(r"[^A-Za-z0-9_.-]+", "-", value)
    return text if re.fullmatch(r"-?\d[\d.]*", text) else text.strip("-.") or "empty"


def as_sweep(words: Words) -> Words:
    """Return the words, with those that give a key several values as a sweep, named after the keys.

    Each combination of values is a variant. Seeds make none: they repeat each variant, and without another
    sweep the fits or edits themselves, see `Sweep.named`.
    """
    from texgs.config.composition import has_several, quoted, several

    swept = [word for word in words if has_several(word)]
    rest = tuple(word for word in words if word not in swept)
    seeds = tuple(
        f"sweep.{SEED_LISTS[key_of(x)]}=[{','.join(several(x))}]" for x in swept if key_of(x) in SEED_LISTS
    )
    over = [word for word in swept if key_of(word) not in SEED_LISTS]
    chosen = [word for word in rest if key_of(word) == "sweep" and word != "sweep=none"]
    if over and chosen:
        raise ConfigError(f"{over[0]}: {chosen[0]} has variants of its own; leave out one of the two")
    if not over:
        return (*rest, *seeds)
    keys = [key_of(word) for word in over]
    name = "-".join((key.partition(".")[2] or key).replace(".", "_") for key in keys)
    name = OF_KINDS if name == OF_NUMBERS else name
    listed = ",".join(map(quoted, over))
    return (*rest, *seeds, f"sweep.name={name}", f"sweep.over=[{listed}]")


@lru_cache(maxsize=64)
def combinations(over: Words) -> Mapping[str, Words]:
    """Return the overrides of each combination of the values of some keys, by the values."""
    from texgs.config.composition import several

    overrides: dict[str, Words] = {}
    for choice in product(*map(several, over)):
        name = "-".join(map(label, choice))
        if name in overrides:
            raise ConfigError(f"sweep.over: expected different variants, got {name} twice")
        pairs = zip(over, choice, strict=True)
        overrides[name] = tuple(f"{word.partition('=')[0]}={value}" for word, value in pairs)
    return overrides


def variant_words(config: Config) -> Mapping[str, Words]:
    """Return the overrides of each variant of the sweep, by name; none without a sweep."""
    sweep = config.sweep
    if sweep.over and sweep.variants:
        raise ConfigError("sweep.over: expected none beside sweep.variants; leave out one of the two")
    given: Mapping[str, Words] = {name: tuple(each) for name, each in sweep.variants.items()}
    if sweep.over:
        given = combinations(tuple(sweep.over))
    if sweep.name == NO_SWEEP:
        if given:
            raise ConfigError("sweep.name: expected a name for the table of the variants, got none")
        return {}
    if not given and all(len(getattr(sweep, listed)) < 2 for listed in SEED_LISTS.values()):
        raise ConfigError(
            f"sweep {sweep.name}: expected variants, keys to sweep over or several seeds, got none of them"
        )
    return given or {ONLY_SEEDS: ()}


def is_of_edits(config: Config) -> bool:
    """Return whether the variants change edits, by keys or seeds; their folders are then named after them."""
    variants = variant_words(config)
    named = any(group_of(change) == EDIT_GROUP for listed in variants.values() for change in listed)
    return bool(variants) and (named or len(config.sweep.edit_seeds) > 1)


def fit_variant(config: Config) -> str:
    """Return the variant in the folder of a fit: `6` of `quick-6`; empty where all variants share fits."""
    return own_name(config, config.variant, FIT_GROUPS) if is_of_edits(config) else config.variant


def edit_variant(config: Config) -> str:
    """Return the variant in the folder of an edit: `0.5` of `style-0.5`; empty where only the fits differ."""
    return config.variant if is_of_edits(config) else ""


def own_name(config: Config, variant: str, groups: Sequence[str]) -> str:
    """Return the name of what overrides of some groups make of a variant; empty where it has none of these.

    In a sweep over keys it is that of their values, so that all variants with the same ones share it.
    """
    own = [change for change in variant_words(config).get(variant, ()) if group_of(change) in groups]
    if not own or not config.sweep.over:
        return variant if own else ""
    return "-".join(label(change.partition("=")[2]) for change in own)


def swept_values(config: Config) -> dict[str, str]:
    """Return what makes a configuration another one than the rest of its sweep: values as text, by keys."""
    listed = variant_words(config).get(config.variant, ())
    texts = {key_of(change): change.partition("=")[2] for change in listed}
    texts |= {key: "" for key, seeds in SEED_LISTS.items() if len(getattr(config.sweep, seeds)) > 1}
    return {key: str(value_at(config, key)) if "." in key else text for key, text in texts.items()}


def variants(case: Case) -> list[Case]:
    """Return each variant of the sweep with each seed; the case itself, where there is no sweep.

    Variants that change the views have a folder of their own for them, unless they name one.
    """
    config = case.config
    by_variant, sweep = variant_words(config), config.sweep
    if not by_variant:
        return [case]
    check_variants(by_variant)
    check_seeds(config)
    case = case.but(*edits_of_sweep(config))
    if is_of_edits(config):
        check_edits(case)
    return [
        case.but(
            *words,
            *own_views(config, name),
            f"variant='{name}'",
            f"fit.seed={seed}",
            f"edit.seed={edit_seed}",
        )
        for name, words in by_variant.items()
        for seed, edit_seed in product(sweep.seeds, sweep.edit_seeds)
    ]


def own_views(config: Config, name: str) -> Words:
    """Return the word that gives a variant a folder for its views, where it changes them and names none."""
    own = own_name(config, name, ("views",))
    is_named = "views.name" in map(key_of, variant_words(config)[name])
    return (f"views.name=views-{own.replace('.', '_')}",) if own and not is_named else ()


def edits_of_sweep(config: Config) -> Words:
    """Return the word with the edits of the sweep, where the experiment has none of its own."""
    if config.edits or config.edit.method != NO_METHOD:
        return ()
    if is_of_edits(config) and not config.sweep.edits:
        raise ConfigError(
            f"sweep {config.sweep.name}: expected an edit that its variants change, got none; "
            "choose one, such as edit=style"
        )
    return (f"edits=[{','.join(config.sweep.edits)}]",) if config.sweep.edits else ()


def check_variants(by_variant: Mapping[str, Sequence[str]]) -> None:
    """Require of variants that they change what may differ between variants."""
    for name, listed in by_variant.items():
        if not name:
            raise ConfigError("sweep.variants: expected a name for each variant, got an empty one")
        for change in listed:
            if elsewhere := ELSEWHERE.get(key_of(change)):
                raise ConfigError(f"sweep.variants.{name}: got {change}, whose values go to {elsewhere}")
            if group_of(change) not in (*FIT_GROUPS, EDIT_GROUP):
                raise ConfigError(
                    f"sweep.variants.{name}: expected overrides of views, fit, device or edit, got {change}; "
                    "the rest is the same for all variants"
                )


def check_seeds(config: Config) -> None:
    """Require seeds, each once, and none that would not count."""
    for key, listed in SEED_LISTS.items():
        seeds, own = getattr(config.sweep, listed), value_at(config, key)
        if not seeds:
            raise ConfigError(f"sweep.{listed}: expected at least one, got none")
        if repeated := [seed for seed in seeds if seeds.count(seed) > 1]:
            raise ConfigError(f"sweep.{listed}: expected different seeds, got {repeated[0]} twice")
        if own and own not in seeds:
            raise ConfigError(f"{key}: expected seeds of a sweep in sweep.{listed}, got {key}={own}")


def check_edits(case: Case) -> None:
    """Require of each edit of a sweep of edits alone that its variants differ."""
    config = case.config
    listed = {key_of(change) for each in variant_words(config).values() for change in each}
    if len(config.sweep.edit_seeds) > 1 or any(group_of(key) != EDIT_GROUP for key in listed):
        return
    tables = {key.split(".")[1] for key in listed}
    for edit in [case.edited(name).config.edit for name in config.edits] or [config.edit]:
        if not tables & {edit.method, *(field.name for field in fields(EditKeys))}:
            raise ConfigError(
                f"sweep {config.sweep.name}: expected to change edit {edit.name}, whose keys are "
                f"edit.{edit.method}, got {', '.join(sorted(listed))}; leave out that edit"
            )
