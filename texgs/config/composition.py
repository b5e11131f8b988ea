"""Compose files of conf/ and overrides by Hydra's rules, into plain values.

Hydra reads the overrides, finds the files and puts them into their order. What it makes of their values, a
configuration with a node for each, takes 0.1 s, and a run has hundreds: here they are merged as they are, and
references to other keys, `${dataset.image}` or `${.name}` for a neighbour, are replaced. For this, this file
alone imports `hydra._internal`; tests/config/test_compose.py compares it with Hydra for all files of conf/.
"""

import os
import re
import warnings
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import asdict
from fnmatch import fnmatchcase
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, cast

from hydra._internal.config_repository import CachingConfigRepository, ConfigRepository
from hydra._internal.config_search_path_impl import ConfigSearchPathImpl
from hydra._internal.defaults_list import create_defaults_list
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, OverrideType, Quote, QuotedString, ValueType
from hydra.core.plugins import Plugins
from hydra.errors import HydraException
from hydra.plugins.config_source import ConfigResult
from omegaconf import OmegaConf

from texgs.config.describe import keys
from texgs.config.mistakes import MISTAKES, unreadable_file
from texgs.config.project import Words
from texgs.config.schema import Config
from texgs.core.errors import ConfigError
from texgs.core.keys import UnknownKey, mismatch

Places = tuple[Path, ...]
SEPARATE_GROUPS = (
    "dataset",
    "views",
    "fit",
    "edit",
    "sweep",
)  # whose files a run combines
REFERENCE = re.compile(r"(?<!\\)\$\{(\.*)([\w.-]+)\}")
MAX_REFERENCES = 20  # length of a chain of references


class Repository(ConfigRepository):
    """Configuration files of several folders; errors name the line that cannot be read."""

    def __init__(self, places: Places) -> None:
        Plugins.instance()  # registers what reads files
        path = ConfigSearchPathImpl()
        for place in places:
            path.append("texgs", f"file://{place}")
        super().__init__(path)
        self.places = places

    def load_config(self, config_path: str) -> ConfigResult | None:
        """Read a file such as `fit/quick`."""
        try:
            return super().load_config(config_path)
        except MISTAKES as error:
            paths = (place / f"{config_path}.yaml" for place in self.places)
            path = next((each for each in paths if each.is_file()), None)
            if path is None:
                raise
            raise unreadable_file(path, error) from error


@lru_cache(maxsize=16)
def repository_of(places: Places, _changed: tuple[int, ...]) -> CachingConfigRepository:
    """Return the repository of some folders in the state of their last change."""
    return CachingConfigRepository(Repository(places))


@lru_cache(maxsize=4096)
def defaults_of(files: CachingConfigRepository, name: str, choices: Words = ()) -> list[tuple[str, str]]:
    """Return names and packages of the files of a configuration, in the order that Hydra gives them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a recipe or an edit by itself needs no _self_
        own = create_defaults_list(
            files, name, [*map(override_of, choices)], prepend_hydra=False, skip_missing=True
        )
    return [(each.config_path or "", each.package or "") for each in own.defaults]


def files_of_choices(files: CachingConfigRepository, choices: Words) -> list[tuple[str, str]]:
    """Return names and packages of the files that some words choose, in rising order of priority.

    What a data set, a recipe or an edit consists of does not depend on other choices, unless its files
    override them: a run, which needs all combinations, lists each once.
    """
    plain = defaults_of(files, "config")
    alone: dict[str, list[tuple[str, str]]] = {}
    dependent: Words = ()
    for word in choices:
        group = override_of(word).key_or_group
        if group in SEPARATE_GROUPS and override_of(word).type is OverrideType.CHANGE:
            own = defaults_of(files, "config", (word,))
            if without_group(own, group) == without_group(plain, group):
                alone[group] = [each for each in own if each[1] == group]
                continue
        dependent = (*dependent, word)
    together = defaults_of(files, "config", dependent)
    for group, own in alone.items():
        at = next(index for index, (_, package) in enumerate(together) if package == group)
        together = [*together[:at], *own, *without_group(together[at:], group)]
    return together


def without_group(listing: list[tuple[str, str]], group: str) -> list[tuple[str, str]]:
    """Return the files that are not of a group."""
    return [each for each in listing if each[1] != group]


@lru_cache(maxsize=4096)
def values_of(files: CachingConfigRepository, name: str, package: str) -> dict[str, Any]:
    """Return the values of a file, by the names of a package such as `fit`."""
    loaded = files.load_config(name)
    values: Any = OmegaConf.to_container(loaded.config) if loaded else {}
    if not isinstance(values, dict):
        raise mismatch(package or name, "keys with values", values)
    for part in reversed(package.split(".") if package else ()):
        values = {part: values}
    return values


def composition(words: Words, places: Places) -> dict[str, Any]:
    """Return the values of all keys; among files with the same name, the first place wins."""
    paths = (path for place in places for path in sorted(place.rglob("*.yaml")))
    files = repository_of(places, tuple(path.stat().st_mtime_ns for path in paths if path.is_file()))
    choices: Words = ()
    for word in words:
        override = override_of(word)
        if override.is_sweep_override():
            raise ConfigError(several_values(word))
        if files.group_exists(override.key_or_group) and not isinstance(override.value(), dict):
            require_name(override)
            choices = (*choices, word)
    values = deepcopy(defaults())
    values["data_folder"] = os.environ.get("TEXGS_DATA", values["data_folder"])
    for name, package in files_of_choices(files, choices):
        merge(values, values_of(files, name, package))
    for word in words:
        if word not in choices:
            apply(values, override_of(word))
    return resolve(values)


@cache
def defaults() -> dict[str, Any]:
    """Return the values of the schema."""
    return asdict(Config())


def require_name(override: Override) -> None:
    """Require that the choice of a group is the name of a file."""
    group, value = override.key_or_group, override.value()
    if isinstance(value, list):
        hint = f"; several go to {group}s" if f"{group}s" in Config.__dataclass_fields__ else ""
        raise ConfigError(f"{group}: expected one name, got a list{hint}")
    if not isinstance(value, str | None):
        raise ConfigError(
            f"{group}: expected the name of a file of conf/, such as dataset=engine, got {value}"
        )


def merge(table: dict[str, Any], later: Mapping[str, Any]) -> None:
    """Update a table with new values; tables are merged, lists replaced."""
    for name, value in later.items():
        if isinstance(value, dict) and isinstance(table.get(name), dict):
            merge(table[name], value)
        else:
            table[name] = deepcopy(value)


@cache
def override_of(word: str) -> Override:
    """Parse a word as a Hydra override; raise OverrideParseException if it is not one."""
    return _parser().parse_overrides([word])[0]


@cache
def _parser() -> OverridesParser:
    return OverridesParser.create()


def has_several(word: str) -> bool:
    """Return whether a word gives its key several values."""
    try:
        return bool(override_of(word).is_sweep_override())
    except HydraException:  # `compose` reports it
        return False


def several(word: str) -> list[str]:
    """Return the values that a word gives its key, in the spelling of the user.

    That is true instead of Hydra's True, and 100000 instead of 1e5 where an integer is expected.
    """
    enumerable = (ValueType.SIMPLE_CHOICE_SWEEP, ValueType.CHOICE_SWEEP, ValueType.RANGE_SWEEP)
    if not has_several(word) or override_of(word).value_type not in enumerable:
        raise ConfigError(
            f"{word}: expected several values, such as fit.low_pass=2,6 or fit.seed=range(3); "
            "a list stands in brackets, a text with a comma in quotes"
        )
    texts = [
        text.lower() if text in ("True", "False") else text
        for text in override_of(word).sweep_string_iterator()
    ]
    key = word.partition("=")[0].lstrip("+")
    is_whole = any(entry.name == key and "float" not in entry.type for entry in keys())
    return [re.sub(r"^(-?\d+)\.0$", r"\1", text) for text in texts] if is_whole else texts


def quoted(word: str) -> str:
    """Return a word as an item of a list."""
    return str(QuotedString(word, Quote.single).with_quotes())


def apply(values: dict[str, Any], override: Override) -> None:
    """Apply a word to the values of all files."""
    key, value = override.key_or_group, override.value()
    *parents, last = key.split(".")
    is_added = override.is_add() or override.is_force_add()
    table: Any = values
    for part in parents:
        if is_added and isinstance(table, dict):
            table.setdefault(part, {})
        table = table[index_of(part, table, key)]
    if override.is_delete():
        if not isinstance(table, dict) or last not in table or value not in (None, table[last]):
            raise UnknownKey(key, "no such key")
        del table[last]
    elif not isinstance(table, dict):
        table[index_of(last, table, key)] = value
    elif last in table or is_added or any(fnmatchcase(key, each.name) for each in keys()):
        merge(table, {last: value})
    else:
        raise UnknownKey(key, "no such key")


def index_of(part: str, table: Any, key: str) -> str | int:
    """Return the name in a table, or the position in a list, that a part of a key addresses."""
    if isinstance(table, dict) and part in table:
        return part
    if isinstance(table, list) and part.isdecimal() and int(part) < len(table):
        return int(part)
    raise UnknownKey(key, "no such key")


def several_values(word: str) -> str:
    """Return the error for a key with several values."""
    key, _, values = word.partition("=")
    is_list = "." in key and "(" not in values  # a group takes no list
    brackets = f", as in '{key}=[{values}]'" if is_list else ""
    return (
        f"{word}: expected one value, got several; a list stands in brackets{brackets}, "
        f"a text with a comma in quotes, and for a sweep there is texgs run {word}"
    )


def resolve(values: dict[str, Any]) -> dict[str, Any]:
    """Replace the references in values, in place where these are simple; return the values.

    Those with resolvers, such as ${oc.env:HOME}, are left to OmegaConf.
    """
    texts = list(_texts(values, ()))
    if any("${" in REFERENCE.sub("", text) for _, _, _, text in texts):
        return cast(dict[str, Any], OmegaConf.to_container(OmegaConf.create(values), resolve=True))
    for table, name, path, text in texts:
        table[name] = _value(values, text, path, MAX_REFERENCES)
    return values


def _texts(table: Any, path: Words) -> Iterator[tuple[Any, Any, Words, str]]:
    """Yield the texts with references: the table or list that holds each, its name there, path and text."""
    for name, value in table.items() if isinstance(table, dict) else enumerate(table):
        if isinstance(value, str):
            if "${" in value:
                yield table, name, (*path, str(name)), value
        elif isinstance(value, dict | list):
            yield from _texts(value, (*path, str(name)))


def _value(values: dict[str, Any], text: str, path: Words, left: int) -> Any:
    """Resolve the references in a text; a text that is a single reference may become any type."""

    def target(match: re.Match[str]) -> Any:
        dots, name = match.groups()
        at = (*(path[: len(path) - len(dots)] if dots else ()), *name.split("."))
        value: Any = values
        for part in at:
            if not isinstance(value, dict) or part not in value:
                raise ConfigError(f"{'.'.join(path)}: {match[0]} refers to {'.'.join(at)}, which is no key")
            value = value[part]
        return _value(values, value, at, left - 1) if isinstance(value, str) and "${" in value else value

    if not left:
        raise ConfigError(f"{'.'.join(path)}: {text} refers to itself; write a value")
    whole = REFERENCE.fullmatch(text)
    return target(whole) if whole else REFERENCE.sub(lambda match: str(target(match)), text)
