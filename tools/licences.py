"""Print docs/licences.md: the licences of the packages in the lock files, as these state them.

`make lock` writes it.
"""

import re
from collections import defaultdict
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

ROOT = Path(__file__).parents[1]
LOCKS = ("requirements.lock", "requirements-torch.lock")
CLASSIFIER = "License :: "
HEADER = """\
# Licences of dependencies

texgs is under Apache-2.0. `make install` installs these packages on Linux, also what only tests need.
Each stands with the licence that its metadata state. `make lock` writes this page.

| licence | packages |
|---|---|
"""


def packages() -> list[str]:
    """The names of all packages in the lock files."""
    text = "".join((ROOT / name).read_text(encoding="utf-8") for name in LOCKS)
    return re.findall(r"^([\w-]+)==", text, flags=re.MULTILINE)


def licence(package: Distribution) -> str:
    """What a package says of its licence: an expression, else classifiers, else a line of text."""
    facts = package.metadata
    if "License-Expression" in facts:
        return facts["License-Expression"]
    listed = [
        each.split(" :: ")[-1] for each in facts.get_all("Classifier", []) if each.startswith(CLASSIFIER)
    ]
    listed = [each for each in listed if each != "OSI Approved"]
    return ", ".join(listed) or facts.get("License", "not stated").strip().splitlines()[0]


def table() -> str:
    """A row for each licence, with its packages that are installed."""
    rows = defaultdict(list)
    for name in packages():
        try:
            rows[licence(distribution(name))].append(name)
        except PackageNotFoundError:  # of another platform or Python
            continue
    return "".join(f"| {key} | {', '.join(names)} |\n" for key, names in sorted(rows.items()))


if __name__ == "__main__":
    print(HEADER + table(), end="")
