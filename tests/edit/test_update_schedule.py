"""Schedules of edits against those of the methods, written out."""

import pytest
import torch

from texgs.core.errors import ArgumentError
from texgs.edit.dataset_update import update_steps
from texgs.edit.methods.dge import DgeKeys
from texgs.edit.methods.dge import schedule as dge
from texgs.edit.methods.igs2gs import Igs2gsKeys
from texgs.edit.methods.igs2gs import schedule as igs2gs
from texgs.edit.methods.in2n import In2nKeys
from texgs.edit.methods.in2n import schedule as in2n
from texgs.edit.methods.updates import UpdateSchedule


def made(schedule, count, seed=0):
    return list(update_steps(schedule, count, torch.Generator().manual_seed(seed)))


def test_in2n_edits_the_next_view_every_ten_iterations_and_learns_from_all():
    steps = made(in2n(In2nKeys(passes=2), 7), 7)
    assert len(steps) == 2 * 7 * 10
    for iteration, step in enumerate(steps):
        assert step.edited == ([iteration // 10 % 7] if iteration % 10 == 0 else [])
        assert list(step.learned) == list(range(7))
    levels = [step.level for step in steps if step.edited]
    assert 0.02 <= min(levels) < max(levels) <= 0.98


def test_igs2gs_edits_all_views_in_turn_and_learns_from_each_at_once():
    steps = made(igs2gs(Igs2gsKeys(every=2500), 162), 162)
    assert len(steps) == 7500
    assert sum(len(step.edited) for step in steps) == 3 * 162
    for iteration, step in enumerate(steps):
        place = iteration % 2500
        assert step.edited == ([place] if place < 162 else [])
        assert list(step.learned) == ([place] if place < 162 else list(range(162)))
    levels = [step.level for step in steps if step.edited]
    assert 0.7 <= min(levels) < max(levels) <= 0.98


def test_dge_edits_twenty_views_together_with_falling_noise_and_learns_from_nothing_else():
    steps = made(dge(DgeKeys(rounds=5), 92), 92)
    assert len(steps) == 2500
    rounds = [step for step in steps if step.edited]
    assert [step.level for step in rounds] == [0.998, 0.3, 0.3, 0.021, 0.021]
    for index, step in enumerate(rounds):
        assert len(set(step.edited)) == 20
        assert list(step.edited) == sorted(step.edited)
        for each in steps[500 * index : 500 * (index + 1)]:
            assert list(each.learned) == list(step.edited)
    assert list(rounds[0].edited) != list(rounds[1].edited)


def test_few_views_are_all_of_a_round():
    (first, *_) = made(UpdateSchedule(1, 3, views=20, group=20, order="random", learned="round"), 4)
    assert list(first.edited) == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("run", "message"),
    [
        (
            lambda: next(update_steps(UpdateSchedule(3, 100), 162, torch.Generator())),
            "expected rounds of at least 162 iterations, in which 162 views are edited, got 100",
        ),
        (lambda: in2n(In2nKeys(noise=[0.9, 0.1]), 3), "edit.in2n.noise: expected two shares from 0 to 1"),
        (lambda: igs2gs(Igs2gsKeys(noise=[0.9]), 3), "edit.igs2gs.noise: expected two shares from 0 to 1"),
        (lambda: dge(DgeKeys(noise=[2.0]), 3), "edit.dge.noise: expected shares from 0 to 1, at least one"),
    ],
)
def test_noise_out_of_range_names_the_key(run, message):
    with pytest.raises(ArgumentError, match=message):
        run()
