"""Settings of the fit: phases as data. The names of presets in conf/fit stand in every table."""

from dataclasses import dataclass, make_dataclass
from typing import Any

from texgs.config.fields import kinds
from texgs.config.keys import key
from texgs.config.phase import Phase, Seeds


@dataclass
class Material:
    """Blinn-Phong factors that the shading phase starts with."""

    ambient: float = key(0.5, "k_a", least=0)
    diffuse: float = key(0.5, "k_d", least=0)
    specular: float = key(0.1, "k_s", least=0)
    shininess: float = key(20.0, "beta", least=0)


@dataclass
class TextureKeys:
    """Texels: how many, and how they are found."""

    texels: int | None = key(None, "in all; default where they are seen, about one per pixel")
    sweeps: int = key(3, "of the least-squares solver over all views", least=0)
    iterations: int = key(0, "of Adam on L1 + D-SSIM afterwards", least=0)
    rate: float = key(0.0025, "of Adam at the start; it falls to a tenth", least=0)
    ridge: float = key(0.2, "of the solver: how strongly texels stay at 0, relative", least=0)
    sparsity: float = key(0.0, "weight of the L1 norm of what texels add to an image", least=0)
    has_offset: bool = key(True, "surfels keep their colours as offsets; the paper has none")


@dataclass
class FitKeys:
    """A recipe. The keys of other fields than surfels stand in tables of their own."""

    name: str = key("default", "of the preset, in tables")
    field: str = key("surfels", "what is fitted", choices=tuple(kinds()))
    seed: int = key(0, "random numbers")
    reduce: int = key(1, "factor by which images are made smaller, by averaging", least=1)
    low_pass: float = key(6.0, "k of the low-pass filter, variance 1/k px^2; stays with the model", least=0)
    facing: bool = key(
        True, "lights shine on the side that faces the viewer; false: on both, as in the paper"
    )
    materials: str = key("shared", "one material for all, or one per surfel", choices=("shared", "surfel"))
    material_range: str = key(
        "bounded", "of its factors: bounded, or as wide as in the paper", choices=("bounded", "paper")
    )
    first_material: Material = key(Material, "before the shading phase")
    seeds: Seeds = key(Seeds, "where surfels start")
    surfels: Phase = key(Phase, "phase 1, with spherical harmonics")
    shading: Phase = key(Phase, "phase 2, with Blinn-Phong")
    texture: TextureKeys = key(TextureKeys, "phase 3")


def _with_kinds() -> Any:
    """The keys of fits of surfels, and a table of keys for each other kind of field."""
    others = [kind for kind in kinds().values() if kind.settings is not None]
    tables = [(kind.name, kind.settings, key(kind.settings, kind.summary)) for kind in others]
    return make_dataclass("Fit", tables, bases=(FitKeys,), namespace={"__doc__": FitKeys.__doc__})


Fit = _with_kinds()
