"""Print requirements.lock: exact versions of everything the Makefile installs (`make lock` writes the file).

pip resolves the loose bounds of pyproject.toml for the oldest supported Python, so that one file serves all.
"""

import json
import subprocess
import sys

TORCH = "torch==2.13.0"
HEADER = """\
# Versions that `make test` installs and tests with, for Python 3.11 to 3.13. Written by `make lock`.
# torch comes as a build for the CPU or for CUDA, whichever is on offer; the packages with CUDA libraries
# are not listed, because torch itself names their exact versions.
"""


def resolve() -> dict[str, str]:
    """Names and versions of texgs' dependencies with all optional groups."""
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--dry-run", "--ignore-installed"]
    command += ["--report", "-", TORCH, ".[dev,bench,models]"]
    report = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    found = (item["metadata"] for item in report["install"])
    return {item["name"].lower().replace("_", "-"): item["version"].split("+")[0] for item in found}


def is_cuda(name: str) -> bool:
    """Whether a package holds CUDA libraries or serves only CUDA builds of torch."""
    return name.startswith(("cuda-", "nvidia-")) or name == "triton"


if __name__ == "__main__":
    versions = resolve()
    lines = [f"{name}=={version}" for name, version in sorted(versions.items()) if not is_cuda(name)]
    print(HEADER + "\n".join(line for line in lines if not line.startswith("texgs==")))
