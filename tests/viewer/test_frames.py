"""The resolution of frames while something moves, and whole frames that newer views stop."""

import asyncio
from functools import wraps

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.viewer.pages import WAIT, on_page, page
from tests.viewer.test_messages import VIEW
from texgs.viewer.frames import (
    LEAST_ROWS,
    LEAST_SCALE,
    MOVING_STEPS,
    SLOW_FRAME,
    SLOWEST_FRAME,
    Frames,
    Pace,
    least_scale,
)

ROWS = 900  # of a whole frame
LEAST = LEAST_ROWS / ROWS


def drag(pace, fixed, per_frame, count=12, rows=ROWS):
    """Frames of a drag that take so long, a part of it in proportion to their pixels; the time of each."""
    seconds = []
    for _ in range(count):
        scale = pace.scale(moving=True)
        seconds.append(fixed + per_frame * scale**2)
        pace.took(seconds[-1], scale, rows)
    return seconds


@given(st.floats(1e-4, 0.2), st.floats(1e-4, 5))
def test_frames_become_fast_or_as_small_as_they_may(fixed, per_frame):
    pace = Pace()
    assert pace.scale(moving=True) == 1
    last, part = drag(pace, fixed, per_frame, count=30)[-1], pace.scale(moving=True)
    if part > LEAST_SCALE / 0.8:
        assert last <= SLOW_FRAME / 0.8**2 * (1 + 1e-9)
    elif part > LEAST / 0.8:
        assert last <= SLOWEST_FRAME / 0.8**2 * (1 + 1e-9) < 0.1
    assert part >= LEAST
    drag(pace, fixed, per_frame, count=5)
    assert pace.scale(moving=True) == part, "the sharpness of a drag stays"


@given(st.floats(1e-4, SLOWEST_FRAME), st.floats(0, 5))
def test_frames_keep_a_third_of_their_sides_where_that_is_fast_enough(third, fixed_part):
    pace = Pace(LEAST_SCALE)
    fixed = third * min(fixed_part, 1)
    drag(pace, fixed, (third - fixed) / LEAST_SCALE**2)
    assert pace.scale(moving=True) >= LEAST_SCALE


@given(st.floats(0.1, 3))
def test_a_drag_that_begins_at_the_smallest_size_is_soon_as_sharp_as_others(per_frame):
    small, whole = Pace(least_scale(ROWS)), Pace()
    assert drag(small, 0.001, per_frame, count=1)[0] < 0.1
    drag(small, 0.001, per_frame), drag(whole, 0.001, per_frame)
    assert 0.6 < small.scale(moving=True) / whole.scale(moving=True) < 1.6


def test_small_windows_keep_a_third():
    assert least_scale(90) == LEAST_SCALE
    assert least_scale(2 * ROWS) == LEAST / 2


def test_a_frame_at_rest_is_whole_and_changes_nothing_of_a_slow_drag():
    pace = Pace()
    drag(pace, 0.001, 0.2)
    before = pace.scale(moving=True)
    assert LEAST_SCALE <= before < 0.6
    assert pace.scale(moving=False) == 1
    pace.took(0.2, 1.0, ROWS)
    assert pace.scale(moving=True) == before


def test_what_becomes_fast_is_whole_again():
    pace = Pace()
    drag(pace, 0.05, 0.2)
    assert pace.scale(moving=True) <= LEAST_SCALE / 0.8
    drag(pace, 0.001, 0.002)
    assert pace.scale(moving=True) == 1


# ---- On a page --------------------------------------------------------------


@pytest.fixture
def begun(monkeypatch):
    """Ids of the frames that have begun; whole ones are rendered again and again, until they are stopped."""
    ids, draw = [], Frames._draw

    @wraps(draw)
    def endless(frames, view, scene, scale):
        ids.append(view.id)
        while not view.moving:
            draw(frames, view, scene, scale)
        return draw(frames, view, scene, scale)

    monkeypatch.setattr(Frames, "_draw", endless)
    return ids


async def until(begun, number):
    """Wait until a frame has begun."""
    async with asyncio.timeout(WAIT):
        while number not in begun:
            await asyncio.sleep(0.001)


@on_page
async def test_a_newer_view_stops_a_whole_frame(browser, begun):
    for number in (1, 3):
        await browser.send(**{**VIEW, "id": number, "moving": False})
        await until(begun, number)
        await browser.send(**{**VIEW, "id": number + 1, "moving": True})
        header, _ = await browser.next("frame")
        assert header["id"] == number + 1
    await browser.send(type="edit", part="TF09", key="opacity", value=1)
    assert "TF09" in (await browser.next("notice"))["text"], "no notice told of what was stopped"


@on_page
async def test_a_page_that_is_gone_stops_its_frame_and_that_of_another_goes_on(browser, client, begun):
    async with page(client) as other:
        await other.send(**{**VIEW, "id": 1, "moving": False})
        await until(begun, 1)
        await browser.send(**{**VIEW, "id": 2, "moving": True})
        await asyncio.sleep(0.1)
        assert begun == [1], "the page does not stop what another one waits for"
    assert (await browser.next("frame"))[0]["id"] == 2


@on_page
async def test_the_first_frame_of_a_volume_is_coarse(browser, client, monkeypatch):
    sizes = []
    monkeypatch.setattr("texgs.viewer.frames.MOVING_STEPS", {**MOVING_STEPS, "normal": 0.5})
    for mode in ("normal", "unshaded"):
        await browser.send(**{**VIEW, "mode": mode, "moving": True})
        sizes.append((await browser.next("frame"))[1].shape[:2])
    assert sizes == [(16, 21), (48, 64)]
