"""The Blinn-Phong factors that materials of surfels can express. Without torch, for checks of plans."""

from collections.abc import Mapping

from texgs.core.errors import ArgumentError

RANGES = {  # of factors, by `fit.material_range`; other factors are not bounded
    "bounded": dict.fromkeys(("ambient", "diffuse", "specular"), (0.0, 1.0)) | {"shininess": (1.0, 100.0)},
    "paper": {"specular": (0.0, 5.0), "shininess": (0.0, 50.0)},  # as in the release
}

MARGIN = 1e-4  # least distance from the ends of a range, relative to its width


def require_material(factors: Mapping[str, float], kind: str) -> None:
    """Require factors inside a range of materials."""
    for name, (low, high) in RANGES[kind].items():
        if not low < factors[name] < high:
            raise ArgumentError(
                f"fit.first_material.{name}: expected a value between {low:g} and {high:g}, as "
                f"material_range={kind} has them, got {factors[name]:g}"
            )


def nearest_material(factors: Mapping[str, float], kind: str) -> dict[str, float]:
    """Clamp factors to a range of materials."""
    nearest = dict(factors)
    for name, (low, high) in RANGES[kind].items():
        margin = MARGIN * (high - low)
        nearest[name] = min(max(factors[name], low + margin), high - margin)
    return nearest
