"""What is wrong with a configuration, in one sentence: the key, or the file of conf/ and its line."""

import dataclasses
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from texgs.config.describe import keys
from texgs.config.project import folders, members, shown
from texgs.config.schema import Config
from texgs.core.errors import ConfigError
from texgs.core.keys import MissingKey, UnknownKey, ValueMismatch
from texgs.core.names import close

RENAMED = {  # keys of the version before; what they are called now
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


@contextmanager
def told() -> Iterator[None]:
    """Make one ConfigError of what Hydra, OmegaConf and `typed` raise."""
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
    """Return what is wrong, from an exception of Hydra or OmegaConf; files that cannot be read: `misread`."""
    named = re.search(r"\b[Ii]n '([^']+)'", str(error))
    files = [folder / f"{named[1]}.yaml" for folder in folders()] if named and named[1] != "config" else []
    where = next((f"{shown(path)}: " for path in files if path.is_file()), "")
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        group, _, name = error.missing_cfg_file.partition("/")
        known = members(group)
        hint = close(name, known) or ("; an address goes to tracking.uri" if group == "tracking" else "")
        hint = hint or f"; one of your own is a file, conf/{group}/{name}.yaml"
        return f"{where}{group}: expected one of {', '.join(known)}, got {name}{hint}"
    if isinstance(error, OverrideParseException):
        return (
            f"{shortened(error.override)}: expected key=value; a value with commas, brackets, ', ! or = "
            "needs quotes inside those of the shell, such as 'edit.text.instruction=\"make it gold!\"'"
        )
    if isinstance(error, TypeError) or "group override" in str(error):
        return "a group: expected the name of a file of conf/, such as dataset=engine, got something else"
    if isinstance(error, RecursionError):
        return "an override: expected fewer brackets, got more than can be read"
    if missing := re.match(r"Could not override '([^']+)'", str(error)):
        return no_such_key(missing[1])
    text = next((line for line in lines(error) if not line.startswith("In '")), type(error).__name__)
    key = getattr(error, "full_key", None)
    return where + shortened(f"{key}: {text[0].lower()}{text[1:]}" if key else text)


def no_such_key(name: str) -> str:
    """Return what to say about a key that the schema does not have."""
    if name in RENAMED:
        return f"{name}: this key is called {RENAMED[name]} now"
    names = [entry.name for entry in keys()]
    groups = dict.fromkeys(each.partition(".")[0] for each in names)
    return f"{name}: no such key{close(name, [*groups, *names])}; texgs views --help lists all"


def origin(key: str, value: Any) -> str:
    """Return the file and line that a wrong value is from, in front of a sentence; empty for an override."""
    group, *below = key.split(".")
    for path in (path for folder in folders() for path in sorted(folder.rglob("*.yaml")) if path.is_file()):
        node = node_at(path, below if package(path) == group else [group, *below])
        if node is not None and str(yaml.SafeLoader("").construct_document(node)) == str(value):
            return f"{shown(path)}:{node.start_mark.line + 1}: "
    return ""


def misread(path: Path) -> str | None:
    """Return what is wrong with a file that cannot be read, else None."""
    data = path.read_bytes()
    try:
        text = data.decode()
        root = yaml.compose(text, yaml.SafeLoader)
        if root is not None and not isinstance(root, yaml.MappingNode):
            kind = "a list" if isinstance(root, yaml.SequenceNode) else "a single value"
            return (
                f"{shown(path)}:1: {package(path) or 'configuration'}: expected keys with values, got {kind}"
            )
        OmegaConf.create(text)
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        return f"{shown(path)}:{line}: expected UTF-8, got byte 0x{data[error.start]:02x}; save it as UTF-8"
    except yaml.reader.ReaderError as error:
        line = text[: error.position].count("\n") + 1
        return f"{shown(path)}:{line}: expected text, got the character #x{error.character:04x}"
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        return f"{shown(path)}:{mark.line + 1 if mark else 1}: {error.problem or error.context}"
    except RecursionError:
        return f"{shown(path)}: expected fewer brackets, got more than can be read"
    except Exception as error:  # of OmegaConf or int(), about one value
        return f"{shown(path)}:{deepest(root).start_mark.line + 1}: {shortened(lines(error)[0])}"
    return None


def deepest(node: yaml.Node) -> yaml.Node:
    """Return the smallest part of a document that OmegaConf does not take."""
    for _, child in children(node):
        try:
            OmegaConf.create([yaml.SafeLoader("").construct_document(child)])
        except Exception:  # what it raises has been told
            return deepest(child)
    return node


def node_at(path: Path, parts: list[str]) -> yaml.Node | None:
    """Return the part of a file below some keys; None where it has none, or cannot be read."""
    try:
        node = yaml.compose(path.read_text(encoding="utf-8"), yaml.CSafeLoader)
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError):
        return None
    for part in parts:
        node = dict(children(node)).get(part) if node else None
    return node


def children(node: yaml.Node) -> list[tuple[str, yaml.Node]]:
    """Return the values of a mapping by their keys, of a list by their numbers."""
    if isinstance(node, yaml.MappingNode):
        return [(str(key.value), value) for key, value in node.value]
    items = node.value if isinstance(node, yaml.SequenceNode) else []
    return [(str(index), value) for index, value in enumerate(items)]


def package(path: Path) -> str:
    """Return the key below which the schema has the keys of a file: the group of its folder, or none."""
    group = path.parent.name
    return group if group in (field.name for field in dataclasses.fields(Config)) else ""


def lines(error: Exception) -> list[str]:
    """Return the lines of an exception, or of the one behind it, that say something."""
    texts = (str(error.__cause__ or ""), str(error))
    return [line.strip() for text in texts for line in text.splitlines() if line.strip()]


def shortened(value: Any) -> str:
    """Return a value as text, cut where it is too long for a sentence."""
    text = str(value)
    return text if len(text) <= 200 else f"{text[:60]}... ({len(text)} characters)"
