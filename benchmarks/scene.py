"""Frames of a composed scene: four textured models, unedited and edited."""

import torch

from benchmarks.fit import DISTANCE, raw_surfels
from benchmarks.report import Section
from benchmarks.settings import Settings
from benchmarks.timing import Case, measure
from texgs.core.camera import orbit
from texgs.core.light import Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import ShadingModel

MODELS, SURFELS, SIDE = 4, 30_000, 4  # models, surfels in each, texels along each side of a texture
CHANGES = ({"palette": (0.2, 0.6, 0.4)}, {"opacity": 0.5}, {"diffuse": 1.5}, {"visible": False})
EDITS = [PartEdit(**change) for change in CHANGES]


def run(settings: Settings) -> Section:
    """Time frames as fitted and edited."""
    section, cases = Section(), []
    composition = Composition([model(seed, settings.device) for seed in range(MODELS)])
    light = Light("directional", 30.0, 40.0)
    for size in settings.sizes:
        camera = orbit(-60.0, 25.0, DISTANCE, 30.0, size, size).to(settings.device)
        for name, edits in (("as fitted", None), ("edited", EDITS)):
            where = {"size": size, "surfels": len(composition), "scene": name}
            show = lambda c=camera, e=edits: composition.render(c, light, e)  # noqa: E731
            cases.append(Case("frame", where, {"frame": show}))
    section.measurements = measure(cases, settings.rounds, settings.device, "scene")
    return section


def model(seed: int, device: torch.device) -> Surfels:
    """A textured model of the generated scenes."""
    raw = raw_surfels(SURFELS, device, seed)
    generator = torch.Generator().manual_seed(seed)
    count = SIDE * SIDE
    texture = {
        "colors": raw["colors"] - 0.5,
        "palette": torch.full((3,), 0.5, device=device),
        "texels": 0.1 * torch.randn(SURFELS * count, 3, generator=generator).to(device),
        "sizes": torch.full((SURFELS, 2), SIDE, dtype=torch.int32, device=device),
        "offsets": count * torch.arange(SURFELS, device=device),
    }
    return Surfels(raw | texture, ShadingModel())
