"""How much of what a volume shows a model shows too, whatever its colours: what a fit has lost."""

from torch import Tensor

ENOUGH = 0.5  # of a pixel's alpha: fits of faint matter err by a tenth of it everywhere, and lose nothing
LEAST = 0.98  # with less, a run says so


def shown_share(alpha: Tensor, truth: Tensor) -> float | None:
    """Return the share of a view's alpha [H, W] in pixels in which a model has half of it at least.

    None where the view shows nothing; faint noise has little weight. The sum of the smaller alpha of both
    would count what is a little fainter everywhere as missing: 0.07 of a translucent fit that has all parts.
    """
    whole = float(truth.sum())
    return float(truth[alpha >= ENOUGH * truth].sum()) / whole if whole else None


def what_is_lost(share: float | None) -> str:
    """Return what to say of a fit that misses parts, and what to do; nothing where it does not."""
    if share is None or share >= LEAST:
        return ""
    return (
        f"the model shows {100 * share:.1f} % of what test views show, so that parts are missing; fit it in "
        "larger views, by fit=default, or with a larger cap of densify"
    )
