import gc
import weakref

import pytest
import torch
from safetensors.torch import save

from tests.raster.requirements import require_equal
from tests.refusals import refused
from texgs.core.errors import FitError
from texgs.core.progress import curve_logger
from texgs.fitting import checkpoint
from texgs.fitting.checkpoint import run_to_end

from .scenes import new_fit, run


@pytest.fixture(scope="module")
def whole():
    """The state at the end of an uninterrupted run."""
    return run(new_fit()).state()


# Densification at 20, 30, 40 and 50, resets at 25 and 50: stops before, on and after some of them.
@pytest.mark.parametrize("stop", [1, 20, 24, 25, 50, 59])
def test_a_resumed_run_is_bit_equal_to_an_uninterrupted_one(tmp_path, whole, stop):
    checkpoint.save(tmp_path, run(new_fit(), stop))
    resumed = run(new_fit(), 7)  # another state of the optimizer, of other surfels
    resumed.restore(checkpoint.latest(tmp_path))
    assert resumed.iteration == stop
    require_equal(run(resumed).state(), whole)


def test_a_state_before_the_first_step_has_no_moments(tmp_path):
    checkpoint.save(tmp_path, new_fit())
    fit = run(new_fit(), 5)
    fit.restore(checkpoint.latest(tmp_path))
    require_equal(run(fit, 12).state(), run(new_fit(), 12).state())


def test_a_checkpoint_replaces_the_one_before(tmp_path):
    assert checkpoint.latest(tmp_path) is None
    assert checkpoint.latest(tmp_path / "not there") is None
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
    refused(lambda: checkpoint.save(tmp_path, fit), "iteration 5: means: .*1 NaN", FitError)
    assert torch.isfinite(checkpoint.latest(tmp_path)["means"]).all()


def test_a_damaged_file_or_one_of_another_kind_is_named(tmp_path):
    path = checkpoint.save(tmp_path, new_fit())
    whole = path.read_bytes()
    for content in (whole[:-100], whole[:4], b"no tensors", save({"means": torch.zeros(1, 3)})):
        path.write_bytes(content)
        refused(lambda: checkpoint.latest(tmp_path), f"{path}: ")


def test_a_resumed_fit_lets_go_of_the_checkpoint(tmp_path, monkeypatch):
    checkpoint.save(tmp_path, run(new_fit(iterations=6), 4))
    fit, read, kept = new_fit(iterations=6), [], []
    restore, go_on = fit.restore, fit.run

    def watched():
        for done in go_on():
            gc.collect()
            kept.append(read[0]() is not None)
            yield done

    monkeypatch.setattr(
        fit, "restore", lambda state: read.append(weakref.ref(state["means"])) or restore(state)
    )
    monkeypatch.setattr(fit, "run", watched)
    run_to_end(fit, tmp_path, "test")
    assert kept == [False, False]


def test_curves_are_told_while_a_fit_runs_and_change_no_bit(tmp_path):
    """A resumed fit tells the losses before it as well."""
    fits = [new_fit(iterations=210) for _ in range(2)]
    run_to_end(fits[0], tmp_path / "unheard", "test")
    checkpoint.save(tmp_path / "heard", run(new_fit(iterations=210), 150))
    told = []
    with curve_logger(lambda values, step: told.append((step, values))):
        run_to_end(fits[1], tmp_path / "heard", "test")
    losses = {step: values["loss"] for step, values in told if "loss" in values}
    assert losses == dict(zip((100, 200, 210), fits[1].losses, strict=True))
    quality = {step: values["train_view_psnr"] for step, values in told if "train_view_psnr" in values}
    assert list(quality) == [150, 200, 210]
    assert 5 < quality[150] <= quality[210] + 1 < 60
    require_equal(fits[1].parameters, fits[0].parameters)


@pytest.mark.parametrize(
    ("count", "iteration", "places"),
    [(3, 3010, [2900, 3000, 3010]), (2, 450, [300, 400]), (1, 100, [100]), (2, 200, [100, 200])],
)
def test_losses_are_of_the_latest_iterations_that_were_looked_at(count, iteration, places):
    """The stages of a fit that note none may come first."""
    assert checkpoint.noted_at(count, iteration, 3010 if iteration > 200 else 200) == places
