"""Keys with several values, in Hydra's syntax: `fit.low_pass=2,6`, `views.train.frequency=range(2,6)`."""

import re
from collections.abc import Mapping
from functools import cache, lru_cache
from itertools import product

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, Quote, QuotedString
from hydra.errors import HydraException

from texgs.config.describe import keys
from texgs.core.errors import ConfigError

SEEDS = {"fit.seed": "seeds", "edit.seed": "edit_seeds"}  # keys of `sweep` with the values of others
ONLY_SEEDS = "seeds"  # name of a sweep over nothing else, and of its only variant


def as_sweep(words: tuple[str, ...]) -> tuple[str, ...]:
    """The words, with those that give a key several values as a sweep, named after the keys.

    Each combination of values is a variant. Seeds make none: they are what means are over.

    Raises:
        ConfigError: if values cannot be listed, or the words choose another sweep.
    """
    several = [word for word in words if has_several(word)]
    if not several:
        return words
    rest = tuple(word for word in words if word not in several)
    seeds = tuple(f"sweep.{SEEDS[key_of(x)]}=[{','.join(values(x))}]" for x in several if key_of(x) in SEEDS)
    over = [word for word in several if key_of(word) not in SEEDS]
    chosen = [word for word in rest if key_of(word) == "sweep" and word != "sweep=none"]
    if over and chosen:
        raise ConfigError(f"{over[0]}: {chosen[0]} has variants of its own; leave out one of the two")
    if chosen:
        return (*rest, *seeds)
    name = "-".join(key_of(word).rpartition(".")[2] for word in over) or ONLY_SEEDS
    listed = ",".join(QuotedString(word, Quote.single).with_quotes() for word in over)
    return (*rest, *seeds, f"sweep.name={name}", f"sweep.over=[{listed}]")


@lru_cache(maxsize=64)
def combinations(over: tuple[str, ...]) -> Mapping[str, tuple[str, ...]]:
    """The overrides of each combination of the values of some keys, by the values."""
    overrides: dict[str, tuple[str, ...]] = {}
    for choice in product(*map(values, over)):
        name = "-".join(map(label, choice))
        if name in overrides:
            raise ConfigError(f"sweep.over: expected different variants, got {name} twice")
        overrides[name] = tuple(
            f"{word.partition('=')[0]}={value}" for word, value in zip(over, choice, strict=True)
        )
    return overrides


def values(word: str) -> list[str]:
    """The values that a word gives its key, in Hydra's syntax; 1e5 is 100000 where an integer is expected."""
    override = parsed(word)
    if override is None or not (override.is_choice_sweep() or override.is_range_sweep()):
        raise ConfigError(
            f"{word}: expected several values, such as fit.low_pass=2,6 or fit.seed=range(3); "
            "a list stands in brackets, a text with a comma in quotes"
        )
    is_whole = any(entry.name == key_of(word) and "float" not in entry.type for entry in keys())
    return [yaml_text(value, is_whole=is_whole) for value in override.sweep_string_iterator()]


def yaml_text(value: str, *, is_whole: bool) -> str:
    """A value of Hydra's as people write it: true, and whole numbers without the point of exponents."""
    if value in ("True", "False"):
        return value.lower()
    return re.sub(r"^(-?\d+)\.0$", r"\1", value) if is_whole else value


def label(value: str) -> str:
    """A value as part of the name of a variant."""
    text = re.sub(r"[^A-Za-z0-9_.-]+", "-", value)
    return text if re.fullmatch(r"-?\d[\d.]*", text) else text.strip("-.") or "empty"


def has_several(word: str) -> bool:
    """Whether a word gives its key several values."""
    override = parsed(word)
    return override is not None and override.is_sweep_override()


@lru_cache(maxsize=1024)
def parsed(word: str) -> Override | None:
    """A word as Hydra reads it; None where it cannot, which `compose` tells."""
    try:
        return _parser().parse_override(word)
    except HydraException:
        return None


def key_of(word: str) -> str:
    """The key or group that an override changes."""
    return word.partition("=")[0].lstrip("+")


@cache
def _parser() -> OverridesParser:
    return OverridesParser.create()
