import os
import subprocess
import sys

import pytest

from texgs.core.waiting import POLICY, waiting

PROGRAM = """
import os
from texgs.core.waiting import waiting
os.environ.update(waiting())
import torch
"""


def test_the_user_decides(monkeypatch):
    for name in POLICY:
        monkeypatch.delenv(name, raising=False)
    assert waiting() == POLICY
    monkeypatch.setenv("OMP_WAIT_POLICY", "active")
    assert waiting() == {"OMP_WAIT_POLICY": "active"}
    monkeypatch.setenv("GOMP_SPINCOUNT", "7")
    assert waiting() == {"OMP_WAIT_POLICY": "active", "GOMP_SPINCOUNT": "7"}


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere torch has another OpenMP")
def test_torch_hears_of_it():
    environment = {name: value for name, value in os.environ.items() if name not in POLICY}
    environment["OMP_DISPLAY_ENV"] = "verbose"
    run = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert "OMP_WAIT_POLICY = 'PASSIVE'" in run.stderr
    assert "GOMP_SPINCOUNT = '1000'" in run.stderr
