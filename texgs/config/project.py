"""Where the workflow and the configurations are: those of texgs, and those of the user's project.

The working directory is the project: its `conf/` comes first, that of texgs after it.
"""

from pathlib import Path

PACKAGE = Path(__file__).parents[1]
INSTALLED = PACKAGE / "_project"  # where a wheel puts them, see CMakeLists.txt
ROOT = INSTALLED if INSTALLED.is_dir() else PACKAGE.parent  # holds Snakefile, conf/ and workflow/
SNAKEFILE = ROOT / "Snakefile"
PROFILES = ROOT / "workflow" / "profiles"


def own_folder() -> Path:
    """The user's configurations: `conf/` of the working directory, which may not be there."""
    return Path.cwd() / "conf"


def folders() -> tuple[Path, ...]:
    """Folders with configurations; of files with the same name, that of the first folder counts."""
    own, shipped = own_folder(), ROOT / "conf"
    return (own, shipped) if own.is_dir() and own.resolve() != shipped.resolve() else (shipped,)


def members(group: str) -> list[str]:
    """Names of the files of a group, such as all data sets."""
    files = (path for folder in folders() for path in (folder / group).glob("*.yaml"))
    return sorted({path.stem for path in files if path.is_file()})


def groups() -> str:
    """The groups of conf/ with their members, a line each."""
    names = {path.name for folder in folders() for path in folder.iterdir() if path.is_dir()}
    return "\n".join(f"  {name}={'|'.join(members(name))}" for name in sorted(names) if members(name))
