"""Print requirements.lock: exact versions and hashes of what the Makefile installs. `make lock` writes it.

uv resolves the loose bounds of pyproject.toml for all supported Pythons and all platforms at once. torch has
a file of its own, which says why. Packages that only a CUDA build of torch needs are left to torch.
"""

import re
import subprocess
import sys
from pathlib import Path

TORCH_FILE = "requirements-torch.lock"
EXTRAS = ("dev", "bench", "models")
HEADER = f"""\
# Versions that `make test` installs and tests with, for Python 3.11 to 3.14, and the hashes of their files.
# Written by `make lock`. torch: see {TORCH_FILE}.
"""


def resolve() -> str:
    """All packages as a requirements file: a line for each, then indented lines with its hashes."""
    command = [sys.executable, "-m", "uv", "pip", "compile", "pyproject.toml", "--constraints", TORCH_FILE]
    command += [word for extra in EXTRAS for word in ("--extra", extra)]
    command += ["--universal", "--python-version", "3.11", "--fork-strategy", "fewest"]
    command += ["--generate-hashes", "--no-annotate", "--no-header", "--quiet"]
    root = Path(__file__).parents[1]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, cwd=root).stdout


def without_torch(requirements: str) -> str:
    """The requirements less torch and the packages that serve only CUDA builds of it."""
    entries = re.findall(r"^\S.*\n(?:[ \t].*\n)*", requirements, flags=re.MULTILINE)
    return "".join(entry for entry in entries if not re.match(r"(torch|triton)==|cuda-|nvidia-", entry))


if __name__ == "__main__":
    print(HEADER + without_torch(resolve()), end="")
