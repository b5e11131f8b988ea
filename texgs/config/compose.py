"""Compose conf/ and overrides into one checked configuration; a mistake is a sentence that names the key."""

import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, cast

from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.config_store import ConfigStore
from hydra.core.plugins import Plugins
from hydra.errors import HydraException
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from texgs.config.describe import Key, keys
from texgs.config.files import origin, shortened
from texgs.config.keys import numbers
from texgs.config.project import folders
from texgs.config.schema import Config
from texgs.config.slips import close, sentence
from texgs.core.errors import ConfigError

RESERVED = (
    "volume",
    "transfer",
    "gallery",
    "logs",
    "mlartifacts",
    "tables",
    "scene",
    "study",
)  # folders below `results`
ALONE = ("fit", "edit")  # groups that depend on no other one but the experiment
LONGEST = 100  # characters of a name: it becomes that of files and folders
NO_TEXT = re.compile("null|true|false|yes|no|on|off|nan|inf(inity)?", re.IGNORECASE)  # to YAML or Hydra


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


class OwnFolders(SearchPathPlugin):
    """Tells Hydra of the folders before that of texgs."""

    folders: ClassVar[tuple[Path, ...]] = ()

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        """Put the folders in front."""
        for folder in reversed(self.folders):
            search_path.prepend("texgs", f"file://{folder}")


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
def _assembled(overrides: tuple[str, ...], places: tuple[Path, ...]) -> DictConfig:
    own = {group: _words(overrides, group) for group in ALONE}
    rest = tuple(word for word in overrides if not any(word in words for words in own.values()))
    config = _compose(rest, places)
    if rest == overrides:
        return config
    chosen = _words(overrides, "experiment")
    nodes = {group: _compose((*chosen, *words), places)[group] for group, words in own.items() if words}
    return changed(config, **nodes)


def changed(config: DictConfig, **values: Any) -> DictConfig:
    """The same configuration, or node of one, with other values of some keys; read only.

    What is below other keys is shared, not copied: a plan has hundreds of configurations.
    """
    made = DictConfig({}, flags={"no_deepcopy_set_nodes": True})
    for name in config:
        made[name] = values.get(str(name), config[name])
    OmegaConf.set_struct(made, True)
    OmegaConf.set_readonly(made, True)
    return made


def _words(overrides: tuple[str, ...], group: str) -> tuple[str, ...]:
    """The words that choose the file of a group, or set a key of it."""
    return tuple(word for word in overrides if re.match(rf"[+~]*{group}(=|\.|$)", word))


@lru_cache(maxsize=256)
def _compose(overrides: tuple[str, ...], places: tuple[Path, ...]) -> DictConfig:
    *own, shipped = places
    if not shipped.is_dir():
        raise ConfigError(f"{shipped}: no configuration there; install texgs again")
    expected = schema()
    Plugins.instance().register(OwnFolders)
    OwnFolders.folders = tuple(own)
    try:
        with initialize_config_dir(str(shipped), version_base="1.3"):
            composed = hydra_compose("config", overrides=list(overrides))
        resolved = OmegaConf.to_container(composed, resolve=True, throw_on_missing=True)
        checked = OmegaConf.merge(expected, resolved)  # refuses keys added by +key=value
    except MISTAKES as error:
        raise ConfigError(sentence(error)) from error
    config = cast(DictConfig, checked)
    check(config)
    OmegaConf.set_readonly(config, True)
    return config


@lru_cache(maxsize=1)
def schema() -> DictConfig:
    """All keys with their types and defaults, known to Hydra as `schema`. Kept: making it takes 0.05 s."""
    made: DictConfig = OmegaConf.structured(Config)
    ConfigStore.instance().store(name="schema", node=made)
    return made


def check(config: DictConfig) -> None:
    """Compare values with the choices and bounds of the schema.

    Raises:
        ConfigError: naming the first key that is out of bounds.
    """
    check_name("dataset.name", config.dataset.name)
    check_name("fit.name", config.fit.name)
    check_name("edit.name", config.edit.name)
    if config.edit.base is not None and not is_scene_file(config.edit.base):
        check_name("edit.base", config.edit.base)
    if not re.fullmatch(r"[A-Za-z0-9_-]*", config.sweep.name):
        raise ConfigError(f"sweep.name: expected letters, digits, _ or -, got {config.sweep.name!r}")
    if not re.fullmatch(rf"([A-Za-z0-9_-][A-Za-z0-9_.-]{{,{LONGEST - 1}}})?", config.variant):
        got = shortened(repr(config.variant))
        raise ConfigError(f"variant: expected at most {LONGEST} letters, digits, _, - or ., got {got}")
    check_name("gallery.name", config.gallery.name)
    for key, name in (("fit.name", config.fit.name), ("gallery.name", config.gallery.name)):
        if re.fullmatch("sheet|comparison|views.*", name):
            raise ConfigError(f"{key}: {name} is a folder of texgs; choose another name")
    if not re.fullmatch("views(-.*)?", config.views.name):
        raise ConfigError(f"views.name: expected views or views-..., got {config.views.name}")
    check_name("views.name", config.views.name)
    for tf in config.dataset.basic_tfs:
        check_name("dataset.basic_tfs", tf)
    check_meshes(config)
    for entry in keys():
        for name, value in values(config, entry.name):
            if value is not None:
                check_value(entry, name, value)


def check_meshes(config: DictConfig) -> None:
    """Require of the basic TFs with meshes that the data set has them, and a volume to compare with.

    Raises:
        ConfigError: naming what it has not.
    """
    known = list(config.dataset.basic_tfs)
    if config.mesh.tfs and config.dataset.views_folder is not None:
        raise ConfigError(
            f"mesh.tfs: data set {config.dataset.name} starts from views and has no volume to compare with; "
            "leave mesh.tfs empty"
        )
    for tf in config.mesh.tfs:
        if tf not in known:
            raise ConfigError(f"mesh.tfs: expected some of {', '.join(known)}, got {tf}{close(tf, known)}")


def check_value(entry: Key, name: str, value: Any) -> None:
    """Compare one value with the choices and bounds of its key.

    Raises:
        ConfigError: naming the key, and the file where the value is from one.
    """
    if entry.choices and value not in entry.choices:
        choices = f"{', '.join(entry.choices)}, got {shortened(value)}{close(value, entry.choices)}"
        raise ConfigError(f"{origin(name, value)}{name}: expected one of {choices}")
    for number in numbers(value):
        if expected := entry.bounds.complaint(number):
            raise ConfigError(f"{origin(name, number)}{name}: expected {expected}, got {shortened(number)}")


def is_scene_file(base: str) -> bool:
    """Whether what an edit starts from is the file of a scene, not the name of another edit."""
    return base.endswith((".yaml", ".yml"))


def check_name(key: str, name: str) -> None:
    """Require a name that can be a folder beside the others below `results`.

    Raises:
        ConfigError: naming the key.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", str(name)):
        got = shortened(repr(name))
        raise ConfigError(f"{key}: expected a letter and then letters, digits, _ or -, got {got}")
    if len(name) > LONGEST:
        raise ConfigError(
            f"{key}: expected at most {LONGEST} characters, got {len(name)}; choose a shorter one"
        )
    if NO_TEXT.fullmatch(name):
        raise ConfigError(
            f"{key}: {name} is a word that YAML or Hydra does not read as text; choose another name"
        )
    if name in RESERVED:
        raise ConfigError(f"{key}: {name} is a folder of texgs; choose another name")


def values(config: Any, name: str) -> Iterator[tuple[str, Any]]:
    """The values of a key, by full name; keys below a list or a dict of tables have several."""
    head, _, rest = name.partition(".")
    if head == "*":
        items = config.items() if hasattr(config, "items") else enumerate(config)
    else:
        items = [(head, config[head])]
    for at, value in items:
        if rest:
            yield from ((f"{at}.{below}", leaf) for below, leaf in values(value, rest))
        else:
            yield str(at), value
