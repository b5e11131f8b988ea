"""Sweeps: the variants of an experiment, as more words for `compose`."""

from texgs.config.compose import compose
from texgs.core.errors import ConfigError


def variants(words: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The words of each variant of the sweep with each seed; the given ones, where there is none.

    Variants that change the views have a folder of their own for them, unless they name one.

    Raises:
        ConfigError: if the sweep has no seed, or a variant changes what must be the same for all.
    """
    sweep = compose(words).sweep
    if not sweep.variants:
        return [words]
    if not sweep.seeds:
        raise ConfigError("sweep.seeds: expected at least one, got none")
    expanded = []
    for name, changes in sweep.variants.items():
        if not name:
            raise ConfigError("sweep.variants: expected a name for each variant, got an empty one")
        for change in changes:
            key = change.split("=")[0].lstrip("+")
            if key.split(".")[0] not in ("views", "fit", "device") or key == "fit.seed":
                raise ConfigError(
                    f"sweep.variants.{name}: expected overrides of views, fit or device, got {change}; "
                    "seeds go to sweep.seeds, the rest is the same for all variants"
                )
        keys = [change.split("=")[0] for change in changes]
        has_views = any(key.startswith("views") for key in keys) and "views.name" not in keys
        folder = (f"views.name=views-{name}",) if has_views else ()
        for seed in sweep.seeds:
            expanded.append((*words, *changes, *folder, f"variant={name}", f"fit.seed={seed}"))
    return expanded
