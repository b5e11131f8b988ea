"""What belongs to texgs in a source tree, where a user's own data sets may be as well."""

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NAMES = """
beetle bonsai chameleon combustion engine five_jets flame fly frog fuel heptane hydrogen iguana ionization
ironprot isosurface jets mantle mni152 neghip orbital rings rotstrat sphere supernova supernova_isosurface
tooth turbulence vortex wood
"""
DATASETS = tuple(NAMES.split())


def tracked(folder: str) -> list[str]:
    """Names of the files of a folder that git knows; skips the test outside of a clone."""
    try:
        done = subprocess.run(
            ["git", "ls-files", folder], cwd=ROOT, capture_output=True, text=True, check=True, timeout=60
        )
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("this is no git clone: nothing tells which files belong to texgs")
    return sorted(Path(line).name for line in done.stdout.splitlines())
