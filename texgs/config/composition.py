"""Compose files of conf/ and overrides by Hydra's rules, into plain values.

Hydra reads the overrides, finds the files and puts them into their order. What it makes of their values, a
configuration with a node for each, takes 0.1 s, and a run has hundreds: here they are merged as they are.
"""

import os
import re
import warnings
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import asdict
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from hydra._internal.config_repository import CachingConfigRepository, ConfigRepository
from hydra._internal.config_search_path_impl import ConfigSearchPathImpl
from hydra._internal.defaults_list import create_defaults_list
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, OverrideType
from hydra.core.plugins import Plugins
from omegaconf import OmegaConf

from texgs.config.describe import keys
from texgs.config.references import resolve
from texgs.config.schema import Config
from texgs.core.errors import ConfigError
from texgs.core.keys import UnknownKey, mismatch

Words = tuple[str, ...]
Places = tuple[Path, ...]
ALONE = ("fit", "edit")  # groups of which a run combines many files with those of others


class Files:
    """The files of some folders, each of which is read once."""

    def __init__(self, places: Places) -> None:
        Plugins.instance()  # registers what reads files
        path = ConfigSearchPathImpl()
        for place in places:
            path.append("texgs", f"file://{place}")
        self.repository = CachingConfigRepository(ConfigRepository(path))
        self._values: dict[str, dict[str, Any]] = {}
        self._listed: dict[tuple[str, Words], list[tuple[str, str]]] = {}

    def is_choice(self, override: Override) -> bool:
        """Return whether an override chooses a file of a group, rather than setting a key."""
        return self.repository.group_exists(override.key_or_group) and not isinstance(override.value(), dict)

    def chosen(self, choices: Words) -> list[tuple[str, str]]:
        """Return names and packages of the files that some words choose, those that count most at the end.

        What a recipe or an edit consists of does not depend on other choices, unless its files override them:
        a run, which needs all combinations, finds each once.
        """
        alone: dict[str, list[tuple[str, str]]] = {}
        for word in choices:
            override = parsed(word)
            if override.key_or_group in ALONE and override.type is OverrideType.CHANGE:
                files = self.listed(f"{override.key_or_group}/{override.value()}")
                alone[override.key_or_group] = files
        if any(package != group for group, files in alone.items() for _, package in files):
            return self.listed("config", choices)
        rest = tuple(word for word in choices if parsed(word).key_or_group not in alone)
        files = self.listed("config", rest)
        for group, own in alone.items():
            at = next(index for index, (_, package) in enumerate(files) if package == group)
            files = [*files[:at], *own, *(each for each in files[at:] if each[1] != group)]
        return files

    def listed(self, name: str, choices: Words = ()) -> list[tuple[str, str]]:
        """Return the files of a configuration in the order that Hydra gives them."""
        if (name, choices) not in self._listed:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # a recipe or an edit by itself needs no _self_
                listed = create_defaults_list(
                    self.repository, name, [*map(parsed, choices)], prepend_hydra=False, skip_missing=True
                )
            files = [(each.config_path or "", each.package or "") for each in listed.defaults]
            self._listed[name, choices] = files
        return self._listed[name, choices]

    def values(self, name: str, package: str) -> dict[str, Any]:
        """Return the values of a file, by the names of a package such as `fit`."""
        if name not in self._values:
            loaded = self.repository.load_config(name)
            values: Any = OmegaConf.to_container(loaded.config) if loaded else {}
            if not isinstance(values, dict):
                raise mismatch(package or name, "keys with values", values)
            for part in reversed(package.split(".") if package else ()):
                values = {part: values}
            self._values[name] = values
        return self._values[name]


@lru_cache(maxsize=16)
def files_of(places: Places, _changed: tuple[int, ...]) -> Files:
    """Return the files of some folders as they are since their last change."""
    return Files(places)


def changes(places: Places) -> tuple[int, ...]:
    """Return when the files of some folders were changed."""
    paths = (path for place in places for path in sorted(place.rglob("*.yaml")))
    return tuple(path.stat().st_mtime_ns for path in paths if path.is_file())


def composition(words: Words, places: Places) -> dict[str, Any]:
    """Return the values of all keys, references to others resolved.

    Args:
        words: overrides in Hydra's syntax.
        places: folders with configurations; of files with the same name, that of the first folder counts.

    Raises:
        HydraException: for a file that is not there, or a word that is no override.
        OmegaConfBaseException, YAMLError, OSError: for a file that cannot be read.
        ConfigError: for a word that cannot be done.
    """
    files, overrides = files_of(places, changes(places)), [parsed(word) for word in words]
    choices = tuple(word for word, each in zip(words, overrides, strict=True) if files.is_choice(each))
    values = asdict(Config())
    values["data_folder"] = os.environ.get("TEXGS_DATA", values["data_folder"])
    for name, package in files.chosen(choices):
        merge(values, files.values(name, package))
    for override in overrides:
        if not files.is_choice(override):
            apply(values, override)
    return resolve(values)


def merge(table: dict[str, Any], later: Mapping[str, Any]) -> None:
    """Put values into a table, in place of those that it has; tables are merged, lists replaced."""
    for name, value in later.items():
        if isinstance(value, dict) and isinstance(table.get(name), dict):
            merge(table[name], value)
        else:
            table[name] = deepcopy(value)


@cache
def parsed(word: str) -> Override:
    """Return a word as Hydra reads it, with a single value.

    Raises:
        OverrideParseException: for a word that is none.
        ConfigError: for several values.
    """
    override = _parser().parse_overrides([word])[0]
    if override.is_sweep_override():
        raise ConfigError(several_values(word))
    return override


@cache
def _parser() -> OverridesParser:
    return OverridesParser.create()


def apply(values: dict[str, Any], override: Override) -> None:
    """Do what a word says, to the values of all files."""
    key, value = override.key_or_group, override.value()
    *parents, last = key.split(".")
    is_added = override.is_add() or override.is_force_add()
    table: Any = values
    for part in parents:
        table = entry(table, part, key, is_added=is_added)
    if not isinstance(table, dict):
        table[position(table, last, key)] = value
    elif override.is_delete():
        if last not in table or value not in (None, table[last]):
            raise UnknownKey(key, "no such key")
        del table[last]
    elif last in table or is_added or is_key(key):
        merge(table, {last: value})
    else:
        raise UnknownKey(key, "no such key")


def entry(table: Any, part: str, key: str, *, is_added: bool) -> Any:
    """Return the part of a table or list that a key goes through."""
    if isinstance(table, list):
        return table[position(table, part, key)]
    if not isinstance(table, dict) or (part not in table and not is_added):
        raise UnknownKey(key, "no such key")
    return table.setdefault(part, {})


def position(table: Any, part: str, key: str) -> int:
    """Return the position in a list that a part of a key names."""
    if not isinstance(table, list) or not part.isdecimal() or int(part) >= len(table):
        raise UnknownKey(key, "no such key")
    return int(part)


def is_key(name: str) -> bool:
    """Return whether the schema has a key; not for names that a table may have any of."""
    patterns = (re.escape(each.name).replace(r"\*", r"[^.]+") for each in keys())
    return any(re.fullmatch(pattern, name) for pattern in patterns)


def several_values(word: str) -> str:
    """Return what to say about a key with several values."""
    key, _, values = word.partition("=")
    is_list = "." in key and "(" not in values  # names of groups are no lists
    brackets = f", as in '{key}=[{values}]'" if is_list else ""
    return (
        f"{word}: expected one value, got several; a list stands in brackets{brackets}, "
        f"a text with a comma in quotes, and for a sweep there is texgs run {word}"
    )
