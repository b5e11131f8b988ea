"""The resolution of frames while a camera moves."""

from hypothesis import given
from hypothesis import strategies as st

from texgs.viewer.frames import LEAST_SCALE, SLOW_FRAME, Pace


def drag(pace, fixed, per_frame, count=12):
    """Frames of a drag that take so long, a part of it in proportion to their pixels; the time of each."""
    seconds = []
    for _ in range(count):
        scale = pace.scale(moving=True)
        seconds.append(fixed + per_frame * scale**2)
        pace.took(seconds[-1], scale)
    return seconds


@given(st.floats(1e-4, 0.2), st.floats(1e-4, 0.5))
def test_frames_become_fast_or_as_small_as_they_may(fixed, per_frame):
    pace = Pace()
    assert pace.scale(moving=True) == 1
    last = drag(pace, fixed, per_frame)[-1]
    assert last <= SLOW_FRAME / 0.8**2 * (1 + 1e-9) or pace.scale(moving=True) <= LEAST_SCALE / 0.8
    before = pace.scale(moving=True)
    drag(pace, fixed, per_frame, count=5)
    assert pace.scale(moving=True) == before, "the sharpness of a drag stays"


def test_a_frame_at_rest_is_whole_and_changes_nothing_of_a_slow_drag():
    pace = Pace()
    drag(pace, 0.001, 0.2)
    before = pace.scale(moving=True)
    assert LEAST_SCALE <= before < 0.6
    assert pace.scale(moving=False) == 1
    pace.took(0.2, 1.0)
    assert pace.scale(moving=True) == before


def test_what_becomes_fast_is_whole_again():
    pace = Pace()
    drag(pace, 0.05, 0.2)
    assert pace.scale(moving=True) <= LEAST_SCALE / 0.8
    drag(pace, 0.001, 0.002)
    assert pace.scale(moving=True) == 1
