"""A project: the folders of its workflow and configurations, and the names that its files can have.

The working directory is the project: its `conf/` comes first, that of texgs after it.
"""

import re
from pathlib import Path

from texgs.core.errors import ConfigError
from texgs.core.keys import mismatch

Words = tuple[str, ...]  # overrides of the configuration, in Hydra's syntax
PACKAGE = Path(__file__).parents[1]
INSTALLED_FOLDER = PACKAGE / "_project"  # where a wheel puts them, see CMakeLists.txt
ROOT = (
    INSTALLED_FOLDER if INSTALLED_FOLDER.is_dir() else PACKAGE.parent
)  # holds Snakefile, conf/ and workflow/
SNAKEFILE = ROOT / "Snakefile"
PROFILES = ROOT / "workflow" / "profiles"

# Folders below `results`.
RESERVED_FOLDERS = ("volume", "transfer", "gallery", "logs", "mlartifacts", "tables", "scene", "study")
MAX_NAME_LETTERS = 100  # of a name, which becomes part of file and folder names
FORBIDDEN_LETTERS = re.compile(r"[^A-Za-z0-9_]+")  # in names of data sets and TFs
NON_TEXT_WORDS = re.compile(
    "null|true|false|yes|no|on|off|nan|inf(inity)?", re.IGNORECASE
)  # to YAML or Hydra


def own_folder() -> Path:
    """Return the user's configuration folder, `conf/` of the working directory; it may not exist."""
    return Path.cwd() / "conf"


def no_project() -> str:
    """Return how to get to a project from a working directory that is none; empty in a project."""
    if own_folder().is_dir():
        return ""
    above = next((path for path in Path.cwd().parents if (path / "conf" / "dataset").is_dir()), "PROJECT")
    return f"this folder has no conf/, so it is no project: cd {above}, or start one by texgs init FOLDER"


def folders() -> tuple[Path, ...]:
    """Return the configuration folders; among files with the same name, the first folder wins."""
    own, shipped = own_folder(), ROOT / "conf"
    return (own, shipped) if own.is_dir() and own.resolve() != shipped.resolve() else (shipped,)


def members(group: str) -> list[str]:
    """Return the names of the files of a group, such as all data sets."""
    files = (path for folder in folders() for path in (folder / group).glob("*.yaml"))
    return sorted({path.stem for path in files if path.is_file()})


def groups() -> str:
    """List the groups of conf/ with their members, one line each."""
    names = {path.name for folder in folders() for path in folder.iterdir() if path.is_dir()}
    return "\n".join(f"  {name}={'|'.join(members(name))}" for name in sorted(names) if members(name))


def short_path(path: Path) -> str:
    """Return a path as the user would write it."""
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def name_of(file: Path) -> str:
    """Return the data set's name from a file name; `check_name` may refuse it."""
    return FORBIDDEN_LETTERS.sub("_", file.name.split(".")[0])


def check_name(key: str, name: str) -> None:
    """Require a name that can be a folder beside the others below `results`.

    Raises:
        ConfigError: naming the key.
    """
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name):
        raise ConfigError(str(mismatch(key, "a letter and then letters, digits, _ or -", name)))
    if len(name) > MAX_NAME_LETTERS:
        raise ConfigError(
            f"{key}: expected at most {MAX_NAME_LETTERS} characters, got {len(name)}; choose a shorter one"
        )
    if NON_TEXT_WORDS.fullmatch(name):
        raise ConfigError(
            f"{key}: {name} is a word that YAML or Hydra does not read as text; choose another name"
        )
    if name.lower() in RESERVED_FOLDERS:  # some file systems ignore case
        raise ConfigError(f"{key}: {name} is a folder of texgs; choose another name")


def is_name(name: str) -> bool:
    """Return whether `check_name` takes a name."""
    try:
        check_name("name", name)
    except ConfigError:
        return False
    return True


def is_scene_file(base: str) -> bool:
    """Return whether an edit starts from a scene file rather than from another edit."""
    return base.endswith((".yaml", ".yml"))
