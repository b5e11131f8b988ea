"""How much of what a volume shows a model shows too, whatever its colours: what a fit has lost."""

from torch import Tensor
from torch.nn.functional import avg_pool2d

AROUND = 3  # pixels of the side of a square whose mean alpha is compared
ENOUGH = 0.5  # of that mean
LEAST = 0.995  # fits that lose nothing have 0.997 or more, one without some leaves of a bonsai 0.991


def shown_share(alpha: Tensor, truth: Tensor) -> float | None:
    """Return the share of a view's alpha [H, W] where a model has half of it at least, as means over 3 x 3.

    None where the view shows nothing; faint noise has little weight. What is finer than pixels differs from
    one to the next, and faint matter by a tenth of its alpha, in fits that have all parts: neither counts.
    The sum of the smaller alpha of both would count them as 0.07 of what there is.
    """
    whole = float(truth.sum())
    if not whole:
        return None
    near, expected = (avg_pool2d(x[None, None], AROUND, 1, AROUND // 2)[0, 0] for x in (alpha, truth))
    return float(truth[near >= ENOUGH * expected].sum()) / whole


def what_is_lost(share: float | None) -> str:
    """Return what to say of a fit that misses parts, and what to do; nothing where it does not."""
    if share is None or share >= LEAST:
        return ""
    return (
        f"the model shows {100 * share:.1f} % of what test views show, so that parts are missing; fit it in "
        "larger views, by fit=default, or with a larger cap of densify"
    )
