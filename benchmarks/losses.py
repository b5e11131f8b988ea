"""The fused losses and shadings, forward and backward, against their definitions in torch and kornia."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from benchmarks import scenes, workload
from benchmarks.report import Section
from benchmarks.settings import Settings
from benchmarks.timing import Case, measure
from texgs.raster import losses, shading
from texgs.raster.reference import losses as definition
from texgs.raster.reference import shading as shading_definition

NAME = "forward+backward"
LAMBDA_DSSIM = 0.2


@dataclass
class Comparison:
    """A function and what computes the same; called with the learned tensors, then the constants."""

    name: str
    functions: dict[str, Callable[..., Tensor]]  # by who wrote it; "texgs" first
    learned: list[Tensor]
    constants: tuple = ()


def run(settings: Settings) -> Section:
    """Time each function, and the others as ratios to ours."""
    section, cases = Section(), []
    for compared in (*images(settings), *surfels(settings)):
        for writer, function in compared.functions.items():
            where = settings.where(function=compared.name, by=writer)
            cases.append(Case(NAME, where, {NAME: differentiated(function, compared)}))
    section.measurements = measure(cases, settings.rounds, settings.device, "losses")
    section.add_ratios("by", "texgs", [NAME], "time")
    return section


def differentiated(function: Callable[..., Tensor], compared: Comparison) -> Callable[[], None]:
    """Forward and backward from a gradient of ones, as that of a loss."""
    copies = (x.detach().clone(memory_format=torch.preserve_format) for x in compared.learned)
    learned = [x.requires_grad_() for x in copies]

    def run() -> None:
        for x in learned:
            x.grad = None
        value = function(*learned, *compared.constants)
        torch.autograd.backward(value, torch.ones_like(value))

    return run


def images(settings: Settings) -> Iterator[Comparison]:
    """Losses on a rendered scene whose target is the same scene, slightly moved."""
    at = (settings.scene, settings.size, settings.n_surfels, settings.device)
    made = workload.plain(*at, channels=4, outputs=("normal", "depth"))
    render, camera = made.image(), scenes.camera(settings.size).to(settings.device)
    color, attributes = render.color[..., :3].detach(), render.color.detach()
    with torch.no_grad():
        made.arguments["means"] += 0.003
    target = made.image().color[..., :3]
    l1_dssim = {"texgs": losses.l1_dssim, "kornia": definition.l1_dssim}
    yield Comparison("l1_dssim", l1_dssim, [color], (target, LAMBDA_DSSIM))
    noise = torch.rand(3, *target.shape[:2], generator=torch.Generator().manual_seed(3)).to(settings.device)
    yield Comparison("l1_dssim, no pixel equal", l1_dssim, [color], (noise.permute(1, 2, 0), LAMBDA_DSSIM))
    pair = {"texgs": losses.normal_consistency, "torch": definition.normal_consistency}
    inputs = [render.normal, render.depth]
    yield Comparison("normal_consistency", pair, inputs, (render.alpha, camera.viewmat, camera.K))
    pair = {"texgs": losses.bilateral_smoothness, "kornia": definition.bilateral_smoothness}
    yield Comparison("bilateral_smoothness, 4 channels", pair, [attributes], (target, render.alpha))


def surfels(settings: Settings) -> Iterator[Comparison]:
    """Shading of the scene's surfels."""
    made = scenes.surfels(settings.scene, settings.n_surfels)
    n, device = settings.n_surfels, settings.device
    made = {name: x.to(device) for name, x in made.items()}
    position = scenes.camera(settings.size).to(device).position
    generator = torch.Generator().manual_seed(4)
    material = list(torch.rand(4, n, generator=generator).mul(0.5).to(device))
    material[3] = 20 * material[3]
    modules = {"texgs": shading, "torch": shading_definition}
    pair = {who: lambda *x, by=module: by.blinn_phong(*x)[0] for who, module in modules.items()}
    learned = [made["features"], *material, made["means"], made["quats"]]
    yield Comparison("blinn_phong", pair, learned, (position,))
    sh = 0.2 * torch.randn(n, 16, 3, generator=generator).to(device)
    pair = {who: module.spherical_harmonics for who, module in modules.items()}
    yield Comparison("spherical_harmonics, degree 3", pair, [sh, made["means"]], (position,))
