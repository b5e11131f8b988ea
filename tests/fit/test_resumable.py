"""Fits that go on from checkpoints: what they keep of them."""

import gc
import weakref

import torch

from texgs.core.progress import curve_logger
from texgs.fit import checkpoint
from texgs.fit.checkpoint import ResumableFit, run_to_end

from .scenes import new_fit


class Counter(ResumableFit):
    """A fit that adds 1 to a tensor, and looks whether what it was restored from is still there."""

    def __init__(self):
        super().__init__(5)
        self.rows = torch.zeros(4)
        self.read, self.was_kept = None, None

    def state(self):
        return {"rows": self.rows, **super().state()}

    def restore(self, state):
        super().restore(state)
        self.read = weakref.ref(state["rows"])
        self.rows = state["rows"].clone()

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


def test_curves_are_told_while_a_fit_runs_and_change_no_bit(tmp_path):
    """A resumed fit tells the losses before it as well."""
    fits = [new_fit(iterations=210) for _ in range(2)]
    run_to_end(fits[0], tmp_path / "unheard", "test")
    first = new_fit(iterations=210)
    for done in first.run():
        if done == 150:
            break
    checkpoint.save(tmp_path / "heard", first)
    told = []
    with curve_logger(lambda values, step: told.append((step, values))):
        run_to_end(fits[1], tmp_path / "heard", "test")
    losses = {step: values["loss"] for step, values in told if "loss" in values}
    assert losses == dict(zip((100, 200, 210), fits[1].losses, strict=True))
    quality = {step: values["train_view_psnr"] for step, values in told if "train_view_psnr" in values}
    assert list(quality) == [150, 200, 210]
    assert 5 < quality[150] <= quality[210] + 1 < 60
    assert all(torch.equal(x, fits[0].parameters[name]) for name, x in fits[1].parameters.items())
