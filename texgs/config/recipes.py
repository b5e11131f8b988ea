"""The schema of conf/fit and conf/edit: common keys, and a table for each kind or method.

The names of presets in conf/fit stand in every table.
"""

from collections.abc import Iterable
from dataclasses import dataclass, make_dataclass
from typing import Any

from texgs.core.keys import key
from texgs.edit.keys import EditKeys
from texgs.edit.method import methods
from texgs.fitting.kinds import fit_specs
from texgs.fitting.settings import Material, Phase, Seeds, TextureKeys


@dataclass(frozen=True)
class FitKeys:
    """A recipe. Fields other than surfels have tables of their own."""

    name: str = key("default", "name of the preset, as in tables")
    field: str = key("surfels", "kind of field that is fitted", choices=tuple(fit_specs()))
    seed: int = key(0, "seed of random numbers", least=0)
    reduce: int = key(1, "factor by which images are made smaller, by averaging", least=1)
    low_pass: float = key(6.0, "k of the low-pass filter, variance 1/k px^2; stays with the model", above=0)
    facing: bool = key(
        True, "lights shine on the side that faces the viewer; false: on both, as in the paper"
    )
    normals: str = key(
        "own",
        "light sees normals that are fitted, or those of the surfels' planes",
        choices=("own", "surfel"),
    )
    materials: str = key("shared", "one material for all, or one per surfel", choices=("shared", "surfel"))
    material_range: str = key(
        "bounded",
        "range of the factors of materials: bounded, or as wide as in the paper",
        choices=("bounded", "paper"),
    )
    attributes: str = key(
        "auto",
        "what colours, normals and material of the shading phase start from; auto: the volume and the light "
        "of its views where there is one; learned: the phase before, and first_material",
        choices=("auto", "learned"),
    )
    hold: float | None = key(
        None,
        "share of their differences from the volume that an iteration takes away; 0: they only start there; "
        "default by how alike its normals are from one surfel to the next",
        least=0,
        most=1,
    )
    first_material: Material = key(Material, "material before the shading phase, of learned attributes")
    seeds: Seeds = key(Seeds, "where surfels start")
    surfels: Phase = key(Phase, "phase 1, with spherical harmonics")
    shading: Phase = key(Phase, "phase 2, with Blinn-Phong")
    texture: TextureKeys = key(TextureKeys, "phase 3")


def _with_tables(name: str, base: type, owners: Iterable[Any]) -> Any:
    """Extend a dataclass by a table of keys for each kind or method."""
    tables = [(each.name, each.settings, key(each.settings, each.summary)) for each in owners]
    return make_dataclass(name, tables, bases=(base,), frozen=True, namespace={"__doc__": base.__doc__})


Fit = _with_tables("Fit", FitKeys, (kind for kind in fit_specs().values() if kind.settings is not None))
Edit = _with_tables("Edit", EditKeys, methods().values())
