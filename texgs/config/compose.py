"""Compose conf/ and overrides into one checked configuration; a mistake is a sentence that names the key."""

import difflib
import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from texgs.config.describe import keys
from texgs.config.schema import Config
from texgs.core.errors import ConfigError

FOLDER = Path(__file__).parents[2] / "conf"
RESERVED = (
    "volume",
    "transfer",
    "logs",
    "benchmarks",
    "mlartifacts",
    "tables",
    "scene",
)  # folders below `results`


@lru_cache(maxsize=256)
def compose(overrides: tuple[str, ...] = ()) -> DictConfig:
    """The configuration, interpolations resolved; read only. Cached, because composing takes 0.1 s.

    Args:
        overrides: words such as ``dataset=engine`` or ``views.width=400``, in Hydra's syntax.

    Raises:
        ConfigError: for an unknown key, group member or value, or one of the wrong type or out of range.
    """
    if not FOLDER.is_dir():
        raise ConfigError(
            f"{FOLDER}: no configuration there; use texgs from a clone, installed with `make install`"
        )
    expected = schema()
    try:
        with initialize_config_dir(str(FOLDER), version_base="1.3"):
            composed = hydra_compose("config", overrides=list(overrides))
        resolved = OmegaConf.to_container(composed, resolve=True, throw_on_missing=True)
        checked = OmegaConf.merge(expected, resolved)  # refuses keys added by +key=value
    except (HydraException, OmegaConfBaseException, ValueError) as error:
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


def members(group: str) -> list[str]:
    """Names of the files of a group, such as all data sets."""
    return sorted(path.stem for path in (FOLDER / group).glob("*.yaml"))


def groups() -> str:
    """The groups of conf/ with their members, a line each."""
    folders = sorted(path for path in FOLDER.iterdir() if path.is_dir())
    return "\n".join(f"  {folder.name}={'|'.join(members(folder.name))}" for folder in folders)


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
    for key, name in (("variant", config.variant), ("sweep.name", config.sweep.name)):
        if not re.fullmatch(r"[A-Za-z0-9_-]*", name):
            raise ConfigError(f"{key}: expected letters, digits, _ or -, got {name!r}")
    if re.fullmatch("sheet|views.*", config.fit.name):
        raise ConfigError(f"fit.name: {config.fit.name} is a folder of texgs; choose another name")
    if not re.fullmatch("views(-.*)?", config.views.name):
        raise ConfigError(f"views.name: expected views or views-..., got {config.views.name}")
    check_name("views.name", config.views.name)
    for tf in config.dataset.basic_tfs:
        check_name("dataset.basic_tfs", tf)
    for entry in keys():
        for name, value in values(config, entry.name):
            choices = entry.choices
            if value is None:
                continue
            if choices and value not in choices:
                raise ConfigError(
                    f"{name}: expected one of {', '.join(choices)}, got {value}{close(value, choices)}"
                )
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if is_number and (expected := entry.bounds.complaint(value)):
                raise ConfigError(f"{name}: expected {expected}, got {value:g}")


def is_scene_file(base: str) -> bool:
    """Whether what an edit starts from is the file of a scene, not the name of another edit."""
    return base.endswith((".yaml", ".yml"))


def check_name(key: str, name: str) -> None:
    """Require a name that can be a folder beside the others below `results`.

    Raises:
        ConfigError: naming the key.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", str(name)):
        raise ConfigError(f"{key}: expected a letter and then letters, digits, _ or -, got {name!r}")
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


def sentence(error: Exception) -> str:
    """What is wrong in one sentence, from an exception of Hydra or OmegaConf."""
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        group, _, name = error.missing_cfg_file.partition("/")
        found = members(group)
        hint = close(name, found) or ("; an address goes to tracking.uri" if group == "tracking" else "")
        return f"{group}: expected one of {', '.join(found)}, got {name}{hint}"
    if isinstance(error, OverrideParseException):
        return (
            f"{error.override}: expected key=value, with quotes around a value that has commas, spaces or ="
        )
    if isinstance(error, ValueError) and "group override" in str(error):
        return "a group: expected the name of a file of conf/, such as dataset=engine, got something else"
    cause = error.__cause__ or error
    lines = [line.strip() for line in str(cause).splitlines() if line.strip()]
    text = lines[0]
    name = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("full_key:")), "")
    if unknown := re.match(r"Key '([^']+)' (?:not in|is not in)", text):
        return no_such_key(name or unknown[1])
    if missing := re.match(r"Could not override '([^']+)'", str(error)):
        return no_such_key(missing[1])
    return f"{name}: {text[0].lower()}{text[1:]}" if name else text


def no_such_key(name: str) -> str:
    """What to say about a key that the schema does not have."""
    return f"{name}: no such key{close(name, [entry.name for entry in keys()])}; texgs views --help lists all"


def close(word: str, known: list[str] | tuple[str, ...]) -> str:
    """A hint at the known word that is most like the given one."""
    found = difflib.get_close_matches(str(word), known, n=1, cutoff=0.6)
    return f", did you mean {found[0]}?" if found else ""
