"""Fits that go on from checkpoints: what they keep of them."""

import gc
import weakref

import torch

from texgs.fit import checkpoint
from texgs.fit.checkpoint import run_to_end


class Counter:
    """A fit that adds 1 to a tensor, and looks whether what it was restored from is still there."""

    unit = "step"

    def __init__(self):
        self.iteration, self.iterations, self.seconds = 0, 5, 0.0
        self.rows = torch.zeros(4)
        self.read, self.was_kept = None, None

    def state(self):
        return {"rows": self.rows, "iteration": torch.tensor(self.iteration)}

    def restore(self, state):
        self.read = weakref.ref(state["rows"])
        self.rows, self.iteration = state["rows"].clone(), int(state["iteration"])

    def run(self):
        while self.iteration < self.iterations:
            gc.collect()
            self.was_kept = self.read is not None and self.read() is not None
            self.iteration += 1
            self.rows = self.rows + 1
            yield self.iteration


def test_a_resumed_fit_goes_on_and_lets_go_of_the_checkpoint(tmp_path):
    stopped = Counter()
    next(stopped.run())
    checkpoint.save(tmp_path, stopped)
    fit = Counter()
    run_to_end(fit, tmp_path, "test")
    assert fit.rows.tolist() == [5] * 4
    assert fit.read is not None
    assert fit.was_kept is False
