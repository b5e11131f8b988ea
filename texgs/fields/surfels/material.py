"""Which Blinn-Phong factors the materials of surfels can express. Without torch: plans are checked by it."""

from collections.abc import Mapping

from texgs.core.errors import ArgumentError

RANGES = {  # that factors can be in, by the range of materials, see `fit.material_range`; others have none
    "bounded": dict.fromkeys(("ambient", "diffuse", "specular"), (0.0, 1.0)) | {"shininess": (1.0, 100.0)},
    "paper": {"specular": (0.0, 5.0), "shininess": (0.0, 50.0)},  # those of the release
}

MARGIN = 1e-4  # of a range, to its ends, which no material reaches


def require_material(factors: Mapping[str, float], kind: str) -> None:
    """Require factors that a range of materials can express."""
    for name, (low, high) in RANGES[kind].items():
        if not low < factors[name] < high:
            raise ArgumentError(
                f"fit.first_material.{name}: expected a value between {low:g} and {high:g}, as "
                f"material_range={kind} has them, got {factors[name]:g}"
            )


def nearest_material(factors: Mapping[str, float], kind: str) -> dict[str, float]:
    """Return the factors that a range of materials can express and that are nearest to others."""
    nearest = dict(factors)
    for name, (low, high) in RANGES[kind].items():
        margin = MARGIN * (high - low)
        nearest[name] = min(max(factors[name], low + margin), high - margin)
    return nearest
