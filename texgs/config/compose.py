"""Compose conf/ and overrides into one checked configuration; a mistake is a sentence that names the key."""

import copy
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf, read_write
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from texgs.config.check import check, check_below
from texgs.config.composition import Places, Words, composition, schema
from texgs.config.project import folders
from texgs.config.slips import sentence
from texgs.core.errors import ConfigError
from texgs.core.typed import Written

NAMED = ("dataset", "fit", "edit")  # groups whose files have names, which folders of results get
ALONE = ("fit", "edit")  # groups that depend on no other one but the experiment

# What Hydra and OmegaConf raise for values and files that they do not understand.
MISTAKES = (
    HydraException,
    OmegaConfBaseException,
    YAMLError,
    ArithmeticError,
    OSError,
    RecursionError,
    TypeError,
    ValueError,
)


def compose(overrides: tuple[str, ...] = (), first: Path | None = None) -> DictConfig:
    """The configuration, interpolations resolved; read only. Cached, because composing takes 0.1 s.

    A run has many data sets, recipes and edits, and needs all combinations of them. The groups ALONE are
    therefore composed once for all data sets, and put into what the other words make.

    Args:
        overrides: words such as ``dataset=engine`` or ``views.width=400``, in Hydra's syntax.
        first: a folder to look for files in before those of the project.

    Raises:
        ConfigError: for an unknown key, group member or value, or one of the wrong type or out of range;
            or a file that cannot be read.
    """
    return _assembled(overrides, (first, *folders()) if first else folders())


@lru_cache(maxsize=1024)
def _assembled(overrides: Words, places: Places) -> DictConfig:
    if not places[-1].is_dir():
        raise ConfigError(f"{places[-1]}: no configuration there; install texgs again")
    by_group = {group: _words(overrides, group) for group in ALONE}
    own = {group: words for group, words in by_group.items() if words}
    rest = tuple(word for word in overrides if not any(word in words for words in own.values()))
    chosen = _words(overrides, "experiment")
    with told():
        nodes = {group: composition((*chosen, *words), places)[group] for group, words in own.items()}
        made = {**composition(rest, places), **nodes}
        config = configuration(composition(overrides, places) if refers(made, nodes) else made)
    check(config)
    check_named(overrides, config)
    return config


def check_named(overrides: Words, config: DictConfig) -> None:
    """Require of chosen files that they have their own names: results would go to the folder of another."""
    for group in NAMED:
        chosen = [word.partition("=")[2].strip("'\"") for word in overrides if word.startswith(f"{group}=")]
        if any(re.match(rf"[+]*{group}\.name=", word) for word in overrides) or not chosen:
            continue
        if (name := config[group].name) != chosen[-1]:
            raise ConfigError(
                f"{group}={chosen[-1]}: expected `name: {chosen[-1]}` in its file, got {name}; "
                f"change it there, or add {group}.name={name}"
            )


def refers(made: dict[str, Any], nodes: dict[str, Any]) -> bool:
    """Whether some groups refer to other keys of the configuration by ${...}, or these to them."""
    return "${" in str(nodes) or any(f"${{{group}" in str(made) for group in nodes)


def configuration(made: dict[str, Any]) -> DictConfig:
    """A configuration with the types of the schema, interpolations resolved; read only.

    Two configurations of a run are nearly the same. Tables with the same values are made once, and shared.
    """
    tables = [key for key, node in schema().items() if OmegaConf.is_dict(node) and key in made]
    plain = {key: value for key, value in made.items() if key not in tables}
    nodes: dict[str, Any] = {}
    for key in map(str, schema()):
        part = {key: made[key]} if key in tables else plain
        node = _checked(Written.of(part))._get_node(key)
        nodes[key] = copy.deepcopy(node) if "${" in str(made.get(key)) else node
    config = together(nodes)
    with read_write(config):
        OmegaConf.resolve(config)
    return config


@lru_cache(maxsize=1024)
def _checked(part: Written) -> DictConfig:
    """The schema with the values of some keys at its top, which are checked."""
    OmegaConf.to_container(OmegaConf.create(part.values), throw_on_missing=True)
    config = cast(DictConfig, OmegaConf.merge(schema(), part.values))  # refuses keys added by +key=value
    for key in part.values:
        check_below(key, config)
    return config


class Same:
    """A configuration as the key of a cache, equal to itself alone: comparing two of them takes long."""

    def __init__(self, config: DictConfig) -> None:
        self.config = config  # kept, so that no other one is at its address

    def __hash__(self) -> int:
        return id(self.config)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and other.config is self.config


def changed(config: DictConfig, **values: Any) -> DictConfig:
    """The same configuration, or node of one, with other values of some keys; read only."""
    return together({str(name): values.get(str(name), config[name]) for name in config})


def together(nodes: dict[str, Any]) -> DictConfig:
    """A configuration of some nodes, which are shared, not copied: a plan has hundreds of them; read only."""
    made = DictConfig({}, flags={"no_deepcopy_set_nodes": True})
    for name, node in nodes.items():
        made[name] = node
    OmegaConf.set_struct(made, True)
    OmegaConf.set_readonly(made, True)
    return made


def _words(overrides: Words, group: str) -> Words:
    """The words that choose the file of a group, or set a key of it."""
    return tuple(word for word in overrides if re.match(rf"[+~]*{group}(=|\.|$)", word))


@contextmanager
def told() -> Iterator[None]:
    """Make one sentence of what Hydra and OmegaConf raise."""
    try:
        yield
    except ConfigError:
        raise
    except MISTAKES as error:
        raise ConfigError(sentence(error)) from error
