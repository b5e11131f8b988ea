import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch

from texgs.core import io
from texgs.core.errors import ArgumentError, FitError
from texgs.fit import checkpoint

from .scenes import new_fit, run

ROOT = Path(__file__).parents[2]
RUNNER = """
import os, sys, torch
torch.set_num_threads(1)
from tests.fit.scenes import new_fit
from texgs.fit import checkpoint
new_fit().step()  # torch imports more at the first step: once is enough
for folder in sys.argv[1:]:
    pid = os.fork()
    if pid == 0:
        fit = new_fit(iterations=2000)
        for _ in fit.run():
            checkpoint.save(folder, fit)
        os._exit(0)
    print(pid, flush=True)
    os.waitpid(pid, 0)
"""


def wait_for(path, seconds=60):
    end = time.monotonic() + seconds
    while not path.exists() and time.monotonic() < end:
        time.sleep(0.001)


def assert_equal_states(state, expected):
    assert state.keys() == expected.keys()
    for name, x in expected.items():
        assert torch.equal(state[name], x), name


@pytest.fixture(scope="module")
def whole():
    """The state at the end of an uninterrupted run."""
    return run(new_fit()).state()


# Densification at 20, 30, 40 and 50, resets at 25 and 50: stops before, on and after some of them.
@pytest.mark.parametrize("stop", [1, 19, 20, 24, 25, 30, 49, 50, 59])
def test_a_resumed_run_is_bit_equal_to_an_uninterrupted_one(tmp_path, whole, stop):
    checkpoint.save(tmp_path, run(new_fit(), stop))
    resumed = new_fit()
    resumed.restore(checkpoint.latest(tmp_path))
    assert resumed.iteration == stop
    assert_equal_states(run(resumed).state(), whole)


def test_resuming_needs_nothing_of_the_seeds(tmp_path, whole):
    checkpoint.save(tmp_path, run(new_fit(), 35))
    fit = new_fit()
    run(fit, 7)  # another state of the optimizer, of other surfels
    fit.restore(checkpoint.latest(tmp_path))
    assert_equal_states(run(fit).state(), whole)


def test_a_state_before_the_first_step_has_no_moments(tmp_path):
    checkpoint.save(tmp_path, new_fit())
    fit = run(new_fit(), 5)
    fit.restore(checkpoint.latest(tmp_path))
    assert_equal_states(run(fit, 12).state(), run(new_fit(), 12).state())


def test_nothing_saved_is_none(tmp_path):
    assert checkpoint.latest(tmp_path) is None
    assert checkpoint.latest(tmp_path / "not there") is None


def test_a_checkpoint_replaces_the_one_before(tmp_path):
    fit = new_fit()
    for stop in (5, 9):
        checkpoint.save(tmp_path, run(fit, stop))
    assert int(checkpoint.latest(tmp_path)["iteration"]) == 9
    assert [path.name for path in tmp_path.iterdir()] == [checkpoint.NAME]


def test_a_state_that_is_not_finite_leaves_the_last_checkpoint(tmp_path):
    fit = run(new_fit(), 5)
    checkpoint.save(tmp_path, fit)
    with torch.no_grad():
        fit.parameters["means"][3, 1] = torch.nan
    with pytest.raises(FitError, match=r"iteration 5: means: .*1 NaN.*last checkpoint is kept"):
        checkpoint.save(tmp_path, fit)
    assert torch.isfinite(checkpoint.latest(tmp_path)["means"]).all()


def test_a_write_that_fails_leaves_the_last_checkpoint(tmp_path, monkeypatch):
    fit = run(new_fit(), 5)
    checkpoint.save(tmp_path, fit)

    def fail(_descriptor):
        raise OSError("power cut")

    monkeypatch.setattr(io.os, "fsync", fail)
    with pytest.raises(OSError, match="power cut"):
        checkpoint.save(tmp_path, run(fit, 8))
    assert int(checkpoint.latest(tmp_path)["iteration"]) == 5


@pytest.mark.parametrize("damage", [lambda data: data[:-100], lambda data: data[:4], lambda _: b"no tensors"])
def test_a_damaged_file_is_named(tmp_path, damage):
    path = checkpoint.save(tmp_path, new_fit())
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(ArgumentError, match=r"safetensors: expected a checkpoint, got .*remove it"):
        checkpoint.latest(tmp_path)


def test_a_file_of_another_kind_is_named(tmp_path):
    from safetensors.torch import save_file

    save_file({"means": torch.zeros(1, 3)}, tmp_path / checkpoint.NAME)
    with pytest.raises(ArgumentError, match="found no iteration"):
        checkpoint.latest(tmp_path)


@pytest.mark.skipif(os.name == "nt", reason="SIGKILL is POSIX")
def test_killed_at_any_moment_a_checkpoint_can_be_read(tmp_path):
    folders = [tmp_path / str(index) for index in range(4)]
    runner = subprocess.Popen(
        [sys.executable, "-c", RUNNER, *folders], cwd=ROOT, stdout=subprocess.PIPE, text=True
    )
    for folder, delay in zip(folders, (0.0, 0.07, 0.13, 0.29), strict=True):
        pid = int(runner.stdout.readline())
        wait_for(Path(folder) / checkpoint.NAME)
        time.sleep(delay)
        os.kill(pid, signal.SIGKILL)
    runner.communicate()
    states = [checkpoint.latest(folder) for folder in folders]
    fit = new_fit(iterations=2000)
    for state in sorted(states, key=lambda state: int(state["iteration"])):
        if fit.iteration < int(state["iteration"]):
            run(fit, int(state["iteration"]))
        assert_equal_states(state, fit.state())
