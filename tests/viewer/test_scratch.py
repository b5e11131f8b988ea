"""Folders of a viewer: what one that was killed has left is removed by the next one."""

import subprocess
import sys
import tempfile

from texgs.viewer.scratch import scratch_folder

KILLED = """
import os, signal
from pathlib import Path
from texgs.viewer.scratch import scratch_folder
folder = scratch_folder()
Path(folder.name, "looks").mkdir()
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_viewer_has_left_is_removed_by_the_next(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    (other := tmp_path / "texgs-view-other-1-x").mkdir()
    alive = scratch_folder()
    subprocess.run([sys.executable, "-c", KILLED])
    assert len(list(tmp_path.iterdir())) == 3
    with scratch_folder() as path:
        assert {str(each) for each in tmp_path.iterdir()} == {str(other), alive.name, path}
    alive.cleanup()
