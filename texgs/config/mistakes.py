"""Mistakes in a configuration as one sentence, with the key, or the file of conf/ and its line."""

import dataclasses
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf.errors import OmegaConfBaseException

from texgs.config.describe import keys
from texgs.config.project import folders, members, no_project, short_path
from texgs.config.schema import Config
from texgs.core.errors import ConfigError
from texgs.core.keys import MissingKey, UnknownKey, ValueMismatch
from texgs.core.names import close

RENAMED_KEYS = {  # new names of keys from the previous version
    "aimed": "per_dataset",
    "each": "common_overrides",
    "missing": "on_missing",
    "device.mapper": "device.renderer",
    "views.mapper": "views.renderer",
}
# What Hydra and OmegaConf raise for values and files that they do not understand.
MISTAKES = (
    *(HydraException, OmegaConfBaseException, yaml.YAMLError),
    *(ArithmeticError, OSError, RecursionError, TypeError, ValueError),
)
MAX_TEXT_LETTERS = 200  # characters of what Hydra or OmegaConf says


@contextmanager
def texgs_errors() -> Iterator[None]:
    """Turn the exceptions of Hydra, OmegaConf and `typed` into a ConfigError."""
    try:
        yield
    except ConfigError:
        raise
    except ValueMismatch as error:
        problem = no_such_key(error.key) if isinstance(error, UnknownKey) else error
        if isinstance(error, MissingKey):
            problem = f"{error}; write it into the file of conf/{error.key.partition('.')[0]}"
        raise ConfigError(f"{origin(error.key, error.value)}{problem}") from error
    except MISTAKES as error:
        raise ConfigError(sentence(error)) from error


def sentence(error: Exception) -> str:
    """Return the mistake behind an exception of Hydra or OmegaConf, as a sentence."""
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        where = re.match(r"In '(?!config')[^']+': ", str(error))
        group, _, name = error.missing_cfg_file.partition("/")
        known = members(group)
        hint = close(name, known) or ("; an address goes to tracking.uri" if group == "tracking" else "")
        outside = no_project()
        if outside and not hint:
            return f"{group}={name}: {outside}; texgs itself has {', '.join(known)}"
        hint = hint or f"; one of your own is a file, conf/{group}/{name}.yaml"
        hint += f" ({outside})" if outside else ""
        return f"{where[0] if where else ''}{group}: expected one of {', '.join(known)}, got {name}{hint}"
    if isinstance(error, OverrideParseException):
        return (
            f"{one_line(error.override)}: expected key=value; a value with commas, brackets, ', ! or = "
            "needs quotes inside those of the shell, such as 'edit.text.instruction=\"make it gold!\"'"
        )
    return one_line(error)


def unreadable_file(path: Path, error: Exception) -> ConfigError:
    """Return the error for an unreadable file, with YAML's line or OmegaConf's key."""
    mark = getattr(error, "problem_mark", None)
    key = getattr(error, "full_key", None)
    where = f"{short_path(path)}{f':{mark.line + 1}' if mark else ''}: {f'{key}: ' if key else ''}"
    if isinstance(error, UnicodeDecodeError):
        return ConfigError(f"{where}expected text in UTF-8; save it as UTF-8")
    return ConfigError(f"{where}{getattr(error, 'problem', None) or one_line(error)}")


def no_such_key(name: str) -> str:
    """Return the error for an unknown key."""
    if name in RENAMED_KEYS:
        return f"{name}: this key is called {RENAMED_KEYS[name]} now"
    names = [entry.name for entry in keys()]
    groups = dict.fromkeys(each.partition(".")[0] for each in names)
    return f"{name}: no such key{close(name, [*groups, *names])}; texgs views --help lists all"


def origin(key: str, value: Any) -> str:
    """Return the file and line of a wrong value, to begin a sentence; empty for an override."""
    group, *below = key.split(".")
    groups = [each.name for each in dataclasses.fields(Config)]
    for path in (path for folder in folders() for path in sorted(folder.rglob("*.yaml")) if path.is_file()):
        is_of_group = path.parent.name in groups  # its files omit the group's name
        if is_of_group and path.parent.name != group:
            continue
        try:
            node = yaml.compose(path.read_text(encoding="utf-8"), yaml.CSafeLoader)
        except (yaml.YAMLError, UnicodeDecodeError, RecursionError):
            continue
        for name in below if is_of_group else (group, *below):
            node = children(node).get(name)
        if node is not None and str(yaml.SafeLoader("").construct_document(node)) == str(value):
            return f"{short_path(path)}:{node.start_mark.line + 1}: "
    return ""


def children(node: yaml.Node | None) -> dict[str, yaml.Node]:
    """Return the values of a mapping by their keys, of a list by their numbers."""
    if isinstance(node, yaml.MappingNode):
        return {str(key.value): value for key, value in node.value}
    items = node.value if isinstance(node, yaml.SequenceNode) else []
    return {str(index): value for index, value in enumerate(items)}


def one_line(error: object) -> str:
    """Return the message of an exception in one line, shortened to fit a sentence."""
    text = " ".join(str(error).partition("\n    full_key: ")[0].split()) or type(error).__name__
    return text if len(text) <= MAX_TEXT_LETTERS else f"{text[:MAX_TEXT_LETTERS]}... ({len(text)} characters)"
