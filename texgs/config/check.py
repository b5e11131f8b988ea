"""Compare a configuration with the choices and bounds of the schema; a mistake is a sentence with the key."""

import re
from collections.abc import Iterator
from typing import Any

from omegaconf import DictConfig

from texgs.config.describe import Key, keys
from texgs.config.files import origin, shortened
from texgs.core.errors import ConfigError
from texgs.core.keys import numbers
from texgs.core.names import close

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
LONGEST = 100  # characters of a name: it becomes that of files and folders
NO_TEXT = re.compile("null|true|false|yes|no|on|off|nan|inf(inity)?", re.IGNORECASE)  # to YAML or Hydra


def check(config: DictConfig) -> None:
    """Compare values with the choices and bounds of the schema."""
    check_name("dataset.name", config.dataset.name)
    check_own_name("gallery.name", config.gallery.name)
    if not re.fullmatch(r"[A-Za-z0-9_-]*", config.sweep.name):
        raise ConfigError(f"sweep.name: expected letters, digits, _ or -, got {config.sweep.name!r}")
    if not re.fullmatch(rf"([A-Za-z0-9_-][A-Za-z0-9_.-]{{,{LONGEST - 1}}})?", config.variant):
        got = shortened(repr(config.variant))
        raise ConfigError(f"variant: expected at most {LONGEST} letters, digits, _, - or ., got {got}")
    if not re.fullmatch("views(-.*)?", config.views.name):
        raise ConfigError(f"views.name: expected views or views-..., got {config.views.name}")
    check_name("views.name", config.views.name)
    for tf in config.dataset.basic_tfs:
        check_name("dataset.basic_tfs", tf)
    check_meshes(config)


def check_below(top: str, config: DictConfig) -> None:
    """Compare the values of one key at the top, or of all below it, with the schema."""
    if top == "fit":
        check_own_name("fit.name", config.fit.name)
    if top == "edit":
        check_name("edit.name", config.edit.name)
        if config.edit.base is not None and not is_scene_file(config.edit.base):
            check_name("edit.base", config.edit.base)
    for entry in keys():
        if entry.name.partition(".")[0] == top:
            for name, value in values(config, entry.name):
                if value is not None:
                    check_value(entry, name, value)


def check_own_name(key: str, name: str) -> None:
    """Require a name as `check_name` does, and not one of the folders beside the fits."""
    check_name(key, name)
    if re.fullmatch("sheet|comparison|views.*", name):
        raise ConfigError(f"{key}: {name} is a folder of texgs; choose another name")


def check_meshes(config: DictConfig) -> None:
    """Require of the basic TFs with meshes that the data set has them, and a volume to compare with."""
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
    """Compare one value with the choices and bounds of its key."""
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
    if name.lower() in RESERVED:  # also where upper and lower case are one
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
