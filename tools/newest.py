"""Install the newest releases of what pyproject.toml asks for, and say which differ from the lock files.

Bounds are ignored, except those that packages have for each other: so one sees what raising a bound would
break. `make newest` runs this, and then the tests.
"""

import re
import subprocess
import sys
import tomllib
from itertools import chain
from pathlib import Path

from lock import EXTRAS

ROOT = Path(__file__).parents[1]
LOCKS = ("requirements.lock", "requirements-torch.lock")
WATCHED = ("snakemake", "hydra-core", "omegaconf", "mlflow", "torch")  # whose undocumented parts texgs uses
PINNED = re.compile(r"^([\w.-]+)==([^\s;+]+)", re.MULTILINE)


def wanted() -> list[str]:
    """The names of all packages that texgs and its tests need."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = [
        *project["dependencies"],
        *chain.from_iterable(project["optional-dependencies"][each] for each in EXTRAS),
    ]
    return [re.split(r"[^\w-]", line)[0] for line in lines]


def versions(text: str) -> dict[str, str]:
    """The version of each package in the lines NAME==VERSION of a text, less what names a build of it."""
    return {name.lower().replace("_", "-"): version for name, version in PINNED.findall(text)}


def said(*command: str | Path) -> str:
    """What a command prints that must succeed."""
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def main(folder: str) -> None:
    """Install into a virtual environment in the folder, and print what differs."""
    said(sys.executable, "-m", "venv", folder)
    pip = [f"{folder}/bin/python", "-m", "pip", "--disable-pip-version-check"]
    index = said(sys.executable, ROOT / "tools" / "torch_index.py").split()
    newest = ["--upgrade", "--upgrade-strategy", "eager", "--no-compile"]
    said(*pip, "install", "--quiet", *newest, *index, *wanted())
    here = ["--no-deps", "--no-build-isolation", "--config-settings", "wheel.cmake=false"]
    said(*pip, "install", "--quiet", *here, "--editable", ROOT)
    locked = versions("".join((ROOT / name).read_text(encoding="utf-8") for name in LOCKS))
    now = versions(said(*pip, "list", "--format=freeze"))
    changed = {
        name: f"{name} {version} -> {now[name]}"
        for name, version in locked.items()
        if name in now and now[name] != version
    }
    for name in WATCHED:
        print(changed.pop(name, f"{name} {locked[name]}, as locked"))
    print(f"{len(changed)} others: {', '.join(changed.values()) or 'none'}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
