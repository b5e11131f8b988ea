"""Settings of the fit: phases as data. The names of presets in conf/fit stand in every table."""

from dataclasses import dataclass, make_dataclass
from typing import Any

from texgs.core.keys import key
from texgs.fit.kinds import fit_specs
from texgs.fit.settings import Material, Phase, Seeds, TextureKeys


@dataclass(frozen=True)
class FitKeys:
    """A recipe. The keys of other fields than surfels stand in tables of their own."""

    name: str = key("default", "name of the preset, as in tables")
    field: str = key("surfels", "kind of field that is fitted", choices=tuple(fit_specs()))
    seed: int = key(0, "seed of random numbers")
    reduce: int = key(1, "factor by which images are made smaller, by averaging", least=1)
    low_pass: float = key(6.0, "k of the low-pass filter, variance 1/k px^2; stays with the model", least=0)
    facing: bool = key(
        True, "lights shine on the side that faces the viewer; false: on both, as in the paper"
    )
    materials: str = key("shared", "one material for all, or one per surfel", choices=("shared", "surfel"))
    material_range: str = key(
        "bounded",
        "range of the factors of materials: bounded, or as wide as in the paper",
        choices=("bounded", "paper"),
    )
    first_material: Material = key(Material, "material before the shading phase")
    seeds: Seeds = key(Seeds, "where surfels start")
    surfels: Phase = key(Phase, "phase 1, with spherical harmonics")
    shading: Phase = key(Phase, "phase 2, with Blinn-Phong")
    texture: TextureKeys = key(TextureKeys, "phase 3")


def _with_kinds() -> Any:
    """Make the keys of fits of surfels, and a table of keys for each other kind of field."""
    others = [kind for kind in fit_specs().values() if kind.settings is not None]
    tables = [(kind.name, kind.settings, key(kind.settings, kind.summary)) for kind in others]
    return make_dataclass(
        "Fit", tables, bases=(FitKeys,), frozen=True, namespace={"__doc__": FitKeys.__doc__}
    )


Fit = _with_kinds()
