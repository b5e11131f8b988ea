"""Install the newest releases of what pyproject.toml asks for, and say which differ from the lock files.

Bounds are ignored, except those that packages have for each other: so one sees what raising a bound would break.
`make newest` runs this, and then the tests.
"""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
LOCKS = ("requirements.lock", "requirements-torch.lock")
WATCHED = ("snakemake", "hydra-core", "omegaconf", "mlflow", "torch")  # whose undocumented parts texgs uses


def wanted() -> list[str]:
    """The names of all packages that texgs and its tests need."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = [*project["dependencies"], *project["optional-dependencies"]["dev"]]
    return [re.match(r"[\w-]+", line).group() for line in lines]


def versions(text: str) -> dict[str, str]:
    """The version of each package in the lines NAME==VERSION of a text."""
    return {
        name.lower().replace("_", "-"): value
        for name, value in re.findall(r"^([\w.-]+)==([^\s;]+)", text, re.M)
    }


def main(folder: str) -> None:
    """Install into a virtual environment in the folder, and print what differs."""
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    pip = [f"{folder}/bin/python", "-m", "pip", "--disable-pip-version-check", "--quiet"]
    index = subprocess.run(
        [sys.executable, ROOT / "tools" / "torch_index.py"], check=True, stdout=-1, text=True
    )
    install = [*pip, "install", "--upgrade", "--upgrade-strategy", "eager", "--no-compile"]
    subprocess.run([*install, *index.stdout.split(), *wanted()], check=True)
    texgs = [
        "--no-deps",
        "--no-build-isolation",
        "--config-settings",
        "wheel.cmake=false",
        "--editable",
        ROOT,
    ]
    subprocess.run([*pip, "install", *texgs], check=True)
    listed = subprocess.run([*pip, "list", "--format=freeze"], check=True, stdout=-1, text=True).stdout
    locked = versions("".join((ROOT / name).read_text(encoding="utf-8") for name in LOCKS))
    now = {name: value.partition("+")[0] for name, value in versions(listed).items()}
    changed = {
        name: f"{name} {locked[name]} -> {now[name]}"
        for name in locked
        if now.get(name, locked[name]) != locked[name]
    }
    for name in WATCHED:
        print(changed.pop(name, f"{name} {locked[name]}, as locked"))
    print(f"{len(changed)} others: {', '.join(changed.values()) or 'none'}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
