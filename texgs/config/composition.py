"""What Hydra makes of conf/ and overrides, kept for later processes: each takes 0.1 s, a run has hundreds."""

import contextlib
import hashlib
import json
import sqlite3
from functools import cache, lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, ClassVar, cast

from hydra import compose, initialize_config_dir
from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.config_store import ConfigStore
from hydra.core.plugins import Plugins
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import DictConfig, OmegaConf

from texgs.config.describe import keys
from texgs.config.schema import Config
from texgs.core.folders import cache_folder
from texgs.core.kept import fingerprint

Words = tuple[str, ...]
Places = tuple[Path, ...]
CACHE = "compositions.sqlite"  # in the cache folder
MOST = 2000  # compositions in it, of some 9 kB each
SECONDS = 1  # to wait for another process that writes
TABLE = "CREATE TABLE IF NOT EXISTS compositions (made_of TEXT UNIQUE, made TEXT)"
OLD = "DELETE FROM compositions WHERE rowid <= (SELECT MAX(rowid) FROM compositions) - ?"


class OwnFolders(SearchPathPlugin):
    """Tells Hydra of the folders before that of texgs."""

    folders: ClassVar[Places] = ()

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        """Put the folders in front."""
        for folder in reversed(self.folders):
            search_path.prepend("texgs", f"file://{folder}")


@lru_cache(maxsize=256)
def composition(overrides: Words, places: Places) -> dict[str, Any]:
    """What Hydra makes of some overrides, interpolations as they are written; not to be changed.

    Args:
        overrides: words in Hydra's syntax.
        places: folders with configurations, that of texgs last.
    """
    depends_on = repr((overrides, places, fingerprint(*places), libraries()))
    made_of = hashlib.sha256(depends_on.encode()).hexdigest()
    made = kept(made_of)
    if made is None:
        made = composed(overrides, places)
        keep(made_of, made)
    return made


def composed(overrides: Words, places: Places) -> dict[str, Any]:
    """What Hydra makes of them now."""
    schema()
    *own, shipped = places
    Plugins.instance().register(OwnFolders)
    OwnFolders.folders = tuple(own)
    with initialize_config_dir(str(shipped), version_base="1.3"):
        made = compose("config", overrides=list(overrides))
    return cast(dict[str, Any], OmegaConf.to_container(made))


@lru_cache(maxsize=1)
def schema() -> DictConfig:
    """All keys with their types and defaults, known to Hydra as `schema`. Kept: making it takes 0.05 s."""
    made: DictConfig = OmegaConf.structured(Config)
    ConfigStore.instance().store(name="schema", node=made)
    return made


@cache
def libraries() -> tuple[object, ...]:
    """The keys that texgs has, and the versions of what composes them."""
    return version("hydra-core"), version("omegaconf"), keys(), OmegaConf.to_container(schema())


def kept(made_of: str) -> dict[str, Any] | None:
    """What the cache has; None where that is nothing, or it cannot be read."""
    with contextlib.suppress(sqlite3.Error, ValueError), database() as connection:
        row = connection.execute("SELECT made FROM compositions WHERE made_of = ?", (made_of,)).fetchone()
        return cast(dict[str, Any], json.loads(row[0])) if row else None
    return None


def keep(made_of: str, made: dict[str, Any]) -> None:
    """Put a composition into the cache, and take the oldest out; where it cannot be written, do nothing."""
    with contextlib.suppress(sqlite3.Error, OSError, TypeError), database() as connection, connection:
        text = json.dumps(made)
        if json.loads(text) == made:  # not so for numbers as keys, and dates
            connection.execute(TABLE)
            connection.execute("INSERT OR REPLACE INTO compositions VALUES (?, ?)", (made_of, text))
            connection.execute(OLD, (MOST,))


def database() -> "contextlib.closing[sqlite3.Connection]":
    """The file with the compositions, open until the end of a `with`."""
    folder = cache_folder()
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    return contextlib.closing(sqlite3.connect(folder / CACHE, timeout=SECONDS))
