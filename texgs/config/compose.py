"""Compose conf/ and overrides into one checked configuration; a mistake is a sentence that names the key."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

from hydra.errors import HydraException
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from texgs.config.check import check
from texgs.config.composition import Places, Words, composition
from texgs.config.files import origin
from texgs.config.project import folders
from texgs.config.schema import Config
from texgs.config.slips import no_such_key, sentence
from texgs.core.errors import ConfigError
from texgs.core.keys import UnknownKey, ValueMismatch, typed

NAMED = ("dataset", "fit", "edit")  # groups whose files have names, which folders of results get

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


def compose(overrides: tuple[str, ...] = (), first: Path | None = None) -> Config:
    """Return the configuration, references resolved.

    Args:
        overrides: words such as ``dataset=engine`` or ``views.width=400``, in Hydra's syntax.
        first: a folder to look for files in before those of the project.

    Raises:
        ConfigError: for an unknown key, group member or value, or one of the wrong type or out of range;
            or a file that cannot be read.
    """
    places = (first, *folders()) if first else folders()
    return _composed(overrides, places, os.environ.get("TEXGS_DATA"))


@lru_cache(maxsize=1024)
def _composed(overrides: Words, places: Places, _data_folder: str | None) -> Config:
    if not places[-1].is_dir():
        raise ConfigError(f"{places[-1]}: no configuration there; install texgs again")
    with told():
        config = typed(Config, composition(overrides, places))
    check(config)
    check_named(overrides, config)
    return config


def check_named(overrides: Words, config: Config) -> None:
    """Require of chosen files that they have their own names: results would go to the folder of another."""
    for group in NAMED:
        chosen = [word.partition("=")[2].strip("'\"") for word in overrides if word.startswith(f"{group}=")]
        if any(re.match(rf"[+]*{group}\.name=", word) for word in overrides) or not chosen:
            continue
        if (name := getattr(config, group).name) != chosen[-1]:
            raise ConfigError(
                f"{group}={chosen[-1]}: expected `name: {chosen[-1]}` in its file, got {name}; "
                f"change it there, or add {group}.name={name}"
            )


@contextmanager
def told() -> Iterator[None]:
    """Make one sentence of what Hydra and OmegaConf raise."""
    try:
        yield
    except UnknownKey as error:
        raise ConfigError(f"{origin(error.key, error.value)}{no_such_key(error.key)}") from error
    except ValueMismatch as error:
        raise ConfigError(f"{origin(error.key, error.value)}{error}") from error
    except ConfigError:
        raise
    except MISTAKES as error:
        raise ConfigError(sentence(error)) from error
