"""Schedules of edits against those of the methods, written out."""

import pytest
import torch

from texgs.core.errors import ArgumentError
from texgs.edit.methods.dge import DgeKeys
from texgs.edit.methods.dge import schedule as dge
from texgs.edit.methods.igs2gs import Igs2gsKeys
from texgs.edit.methods.igs2gs import schedule as igs2gs
from texgs.edit.methods.in2n import In2nKeys
from texgs.edit.methods.in2n import schedule as in2n
from texgs.edit.turns import Schedule, turns


def made(schedule, count, seed=0):
    return list(turns(schedule, count, torch.Generator().manual_seed(seed)))


def test_in2n_edits_the_next_view_every_ten_iterations_and_learns_from_all():
    all_turns = made(in2n(In2nKeys(passes=2), 7), 7)
    assert len(all_turns) == 2 * 7 * 10
    for iteration, turn in enumerate(all_turns):
        assert turn.edited == ([iteration // 10 % 7] if iteration % 10 == 0 else [])
        assert list(turn.learned) == list(range(7))
    levels = [turn.level for turn in all_turns if turn.edited]
    assert 0.02 <= min(levels) < max(levels) <= 0.98


def test_igs2gs_edits_all_views_in_turn_and_learns_from_each_at_once():
    all_turns = made(igs2gs(Igs2gsKeys(every=2500), 162), 162)
    assert len(all_turns) == 7500
    assert sum(len(turn.edited) for turn in all_turns) == 3 * 162
    for iteration, turn in enumerate(all_turns):
        place = iteration % 2500
        assert turn.edited == ([place] if place < 162 else [])
        assert list(turn.learned) == ([place] if place < 162 else list(range(162)))
    levels = [turn.level for turn in all_turns if turn.edited]
    assert 0.7 <= min(levels) < max(levels) <= 0.98


def test_dge_edits_twenty_views_together_with_falling_noise_and_learns_from_nothing_else():
    all_turns = made(dge(DgeKeys(rounds=5), 92), 92)
    assert len(all_turns) == 2500
    rounds = [turn for turn in all_turns if turn.edited]
    assert [turn.level for turn in rounds] == [0.998, 0.3, 0.3, 0.021, 0.021]
    for index, turn in enumerate(rounds):
        assert len(set(turn.edited)) == 20
        assert list(turn.edited) == sorted(turn.edited)
        for each in all_turns[500 * index : 500 * (index + 1)]:
            assert list(each.learned) == list(turn.edited)
    assert list(rounds[0].edited) != list(rounds[1].edited)


def test_few_views_are_all_of_a_round():
    (first, *_) = made(Schedule(1, 3, views=20, group=20, order="random", learned="round"), 4)
    assert list(first.edited) == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"rounds": 0, "period": 1}, "rounds: expected at least 1, got 0"),
        ({"rounds": 1, "period": 1, "group": 0}, "group: expected at least 1, got 0"),
        ({"rounds": 1, "period": 1, "levels": ((0.5, 1.5),)}, "levels: expected ranges from 0 to 1"),
        ({"rounds": 1, "period": 1, "levels": ()}, "levels: expected ranges from 0 to 1, at least one"),
    ],
)
def test_what_no_schedule_can_be(values, message):
    with pytest.raises(ArgumentError, match=message):
        Schedule(**values)


@pytest.mark.parametrize(
    ("run", "message"),
    [
        (
            lambda: next(turns(Schedule(3, 100), 162, torch.Generator())),
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
