"""Fits while somebody waits, of a moment."""

import pytest

from texgs.fitting import casting, now


def shorten(patch: pytest.MonkeyPatch, *, frequency: int, surfels: int, iterations: int) -> None:
    """Let `fit_now` take so many surfels and iterations of each pass, and views of an icosphere."""
    patch.setattr(casting, "FREQUENCY", frequency)
    patch.setattr(now, "SURFELS", surfels)
    patch.setattr(now, "PASSES", (iterations, iterations))
