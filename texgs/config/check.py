"""Names in a configuration, of which folders and files are made; a mistake is a sentence with the key."""

import re

from texgs.config.files import shortened
from texgs.config.schema import Config
from texgs.core.errors import ConfigError
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


def check(config: Config) -> None:
    """Require names that folders can have, and meshes of basic TFs that are there."""
    check_name("dataset.name", config.dataset.name)
    check_own_name("fit.name", config.fit.name)
    check_name("edit.name", config.edit.name)
    if config.edit.base is not None and not is_scene_file(config.edit.base):
        check_name("edit.base", config.edit.base)
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


def check_own_name(key: str, name: str) -> None:
    """Require a name as `check_name` does, and not one of the folders beside the fits."""
    check_name(key, name)
    if re.fullmatch("sheet|comparison|views.*", name):
        raise ConfigError(f"{key}: {name} is a folder of texgs; choose another name")


def check_meshes(config: Config) -> None:
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
