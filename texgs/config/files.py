"""Files of conf/ that are not as they should be: which, and on which line."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from omegaconf import OmegaConf

from texgs.config.project import folders
from texgs.config.schema import Config


def files() -> Iterator[Path]:
    """All files of conf/, the user's own first."""
    for folder in folders():
        yield from sorted(path for path in folder.rglob("*.yaml") if path.is_file())


def place(path: Path | None, key: str) -> str:
    """The file in front of a sentence, with the line of a key where that is found."""
    if path is None:
        return ""
    parts = key.split(".")
    nodes = (node_at(path, parts[skipped:]) for skipped in range(len(parts)))
    node = next((node for node in nodes if node is not None), None) if key else None
    return f"{shown(path)}:{node.start_mark.line + 1}: " if node else f"{shown(path)}: "


def origin(key: str, value: Any) -> str:
    """Return the file and line that a wrong value is from, in front of a sentence; empty for an override."""
    group, *below = key.split(".")
    for path in files():
        node = node_at(path, below if package(path) == [group] else [group, *below])
        if node is not None and str(yaml.safe_load(yaml.serialize(node))) == str(value):
            return f"{shown(path)}:{node.start_mark.line + 1}: "
    return ""


def shown(path: Path) -> str:
    """A path as the user would write it."""
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def slip(path: Path) -> str | None:
    """What is wrong with a file that cannot be read else None."""
    data = path.read_bytes()
    try:
        text = data.decode()
        root = yaml.compose(text, yaml.SafeLoader)
        if root is not None and not isinstance(root, yaml.MappingNode):
            kind = "a list" if isinstance(root, yaml.SequenceNode) else "a single value"
            key = ".".join(package(path)) or "configuration"
            return f"{shown(path)}:1: {key}: expected keys with values, got {kind}"
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
        node = deepest(root)
        return f"{shown(path)}:{node.start_mark.line + 1}: {shortened(lines(error)[0])}"
    return None


def package(path: Path) -> list[str]:
    """Where the schema has the keys of a file: in the group of its folder, or at the top."""
    group = path.parent.name
    return [group] if group in (field.name for field in dataclasses.fields(Config)) else []


def deepest(node: yaml.Node) -> yaml.Node:
    """The smallest part of a document that OmegaConf does not take."""
    for _, child in children(node):
        try:
            OmegaConf.create([yaml.safe_load(yaml.serialize(child))])
        except Exception:  # what it raises has been told
            return deepest(child)
    return node


def children(node: yaml.Node) -> list[tuple[str, yaml.Node]]:
    """The values of a mapping by their keys, of a list by their numbers."""
    if isinstance(node, yaml.MappingNode):
        return [(str(key.value), value) for key, value in node.value]
    items = node.value if isinstance(node, yaml.SequenceNode) else []
    return [(str(index), value) for index, value in enumerate(items)]


def node_at(path: Path, parts: list[str]) -> yaml.Node | None:
    """The part of a file below some keys; None where it has none, or cannot be read."""
    try:
        text = path.read_text(encoding="utf-8")
        if any(part not in text for part in parts if not part.isdigit()):
            return None  # without parsing, which takes 0.03 s
        node = yaml.compose(text, yaml.SafeLoader)
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError):
        return None
    for part in parts:
        node = dict(children(node)).get(part) if node else None
    return node


def lines(error: Exception) -> list[str]:
    """The lines of an exception, or of the one behind it, that say something."""
    texts = (str(error.__cause__ or ""), str(error))
    return [line.strip() for text in texts for line in text.splitlines() if line.strip()]


def shortened(value: Any) -> str:
    """A value as text, cut where it is too long for a sentence."""
    text = str(value)
    return text if len(text) <= 200 else f"{text[:60]}... ({len(text)} characters)"
