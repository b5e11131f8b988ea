"""Damaged files of every kind are read, or refused in a sentence: no traceback, abort, hang or flood.

TEXGS_FUZZ_CASES is the number of files for each reader. A seed that fails gives the same file again:
`damaged(READERS[name], whole file, seed)` of tests/fuzz/child.py.
"""

import json
import multiprocessing
import os
from multiprocessing import forkserver
from pathlib import Path

import pytest

from tests.fuzz.child import run
from tests.fuzz.readers import READERS
from texgs.core.errors import MAX_LETTERS

pytestmark = pytest.mark.subprocess

CASES = int(os.environ.get("TEXGS_FUZZ_CASES", "20"))
# A file of these takes a second.
IN_A_PROCESS_EACH = (".vti", ".pvti", ".vtr", ".vtk", ".slc", ".mha", ".mhd", ".nrrd", ".nhdr", "samples")
SECONDS = 300.0  # for all files of a reader
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def context():
    """Starts processes in which the libraries are loaded already."""
    chosen = multiprocessing.get_context("forkserver")
    chosen.set_forkserver_preload(["tests.fuzz.child"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(ROOT))
        patch.setenv("OMP_NUM_THREADS", "1")
        forkserver.ensure_running()
    return chosen


@pytest.mark.skipif(os.name == "nt", reason="limits of memory are POSIX")
@pytest.mark.parametrize("name", READERS)
def test_damage_is_told_or_harmless(tmp_path, context, name):
    cases = max(1, CASES // 10) if name.endswith(IN_A_PROCESS_EACH) else CASES
    process = context.Process(target=run, args=(name, range(cases), tmp_path))
    process.start()
    process.join(SECONDS)
    if process.is_alive():
        process.kill()
        process.join()
    assert (tmp_path / "outcomes").exists(), "the whole file could not be read"
    lines = [json.loads(line) for line in (tmp_path / "outcomes").read_text().splitlines()]
    assert process.exitcode == 0, (
        f"{name}, seed {lines[-1][0]}: the process ended with {process.exitcode}\n"
        f"{(tmp_path / 'hangs').read_text()}"
    )
    outcomes = [line for line in lines if len(line) > 1]
    assert len(outcomes) == cases
    assert [line for line in outcomes if line[1] not in ("valid", "refused")] == []
    assert [line for line in outcomes if not line[2].isprintable() or len(line[2]) > 1.2 * MAX_LETTERS] == []
    assert any(line[1] == "refused" for line in outcomes), "no damage was found at all"
