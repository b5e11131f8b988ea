"""gsplat's torch functions for 2DGS on a CPU, handed the list of fragments for nothing."""

import torch
from torch import Tensor

from benchmarks import workload
from benchmarks.report import Measurement, Section
from benchmarks.settings import Settings
from benchmarks.timing import Case, measure
from texgs.raster import Options, rasterize

PEER = "gsplat's torch functions"
LIKE_GSPLAT = Options(low_pass=2.0, filter_sigma=1.0, near=0.01, far=1e10)
OURS = "texgs, as gsplat"
SCENES = (("light", 400), ("opaque", 400), ("light", 800))  # at these sizes it takes 1 to 3 GB
MOST_SURFELS = 60_000
CHUNK = 2_000_000  # candidate fragments looked at together


class Peer(workload.Workload):
    """A workload that gsplat renders."""

    def forward(self) -> None:
        """Project and blend, for colour and normals."""
        from tests.raster import gsplat_torch

        for tensor in self.learned:
            tensor.grad = None
        self.render = gsplat_torch.rasterize(**self.arguments, listed=self.fragments)


def compare(settings: Settings, section: Section) -> None:
    """Time forward + backward of both with the same output, colour and normals; compare the images."""
    import pytest

    from tests.raster import gsplat_torch

    try:
        gsplat_torch.load()
    except pytest.skip.Exception as reason:
        section.skip(PEER, str(reason))
        return
    n = min(settings.n_surfels, MOST_SURFELS)
    for scene, size in dict.fromkeys((scene, min(size, settings.size)) for scene, size in SCENES):
        ours = workload.plain(scene, size, n, settings.device, outputs=("normal",), options=LIKE_GSPLAT)
        theirs = Peer(ours.arguments, ours.learned, workload.interleaved(ours.cotangents))
        theirs.fragments = fragments(ours.arguments)
        where = {"scene": scene, "size": size, "surfels": n}
        section.measurements += _time(ours, theirs, where, settings)


def _time(ours: workload.Workload, theirs: Peer, where: dict, settings: Settings) -> list[Measurement]:
    """Times of both, their ratio, and the difference of the images."""
    cases = [
        Case("forward+backward", where | {"peer": PEER}, theirs.forward_backward),
        Case("forward+backward", where | {"peer": OURS}, ours.forward_backward),
    ]
    timed = Section(measure(cases, max(settings.rounds - 2, 1), settings.device, f"{PEER}, {where['scene']}"))
    a, b = (timed.find("forward+backward", peer=peer) for peer in (PEER, OURS))
    ratio = a.over(b, "forward+backward / texgs", fragments=len(theirs.fragments[0]))
    theirs.forward()
    difference = float((theirs.render.color.detach() - ours.image().color).abs().mean())
    name = "mean difference of images"
    return [*timed.measurements, ratio, Measurement.of(name, where | {"peer": PEER}, "1", [difference])]


@torch.no_grad()
def fragments(a: dict) -> tuple[Tensor, Tensor]:
    """Surfel and pixel [F] of the fragments that we blend, pixel by pixel and front to back."""
    from tests.raster import gsplat_torch

    names = ("means", "quats", "scales", "viewmat", "K", "width", "height", "options")
    centres, depths, homographies, _ = (x[0] for x in gsplat_torch.project(*(a[name] for name in names)))
    radii = rasterize(**a | {"outputs": ("statistics",)}).statistics.radii
    reach = radii.ceil().mul(1.1).add(2).long()  # the box's middle is not quite the centre
    seen = (radii > 0).nonzero().squeeze(1)
    parts = []
    for chunk in seen.split(max(1, CHUNK // int((2 * reach.max() + 1) ** 2))):
        parts.append(_candidates(chunk, reach, centres, homographies, a))
    surfels, pixels, alphas = (torch.cat(part) for part in zip(*parts, strict=True))
    nearest = torch.argsort(depths, stable=True)
    rank = torch.empty_like(nearest).scatter_(0, nearest, torch.arange(len(depths)))
    order = torch.argsort(pixels * len(depths) + rank[surfels])
    surfels, pixels, alphas = surfels[order], pixels[order], alphas[order]
    light = gsplat_torch.weights_by_ray(alphas, pixels, a["width"] * a["height"])[1]
    kept = light * (1 - alphas) >= a["options"].transmittance_min
    return surfels[kept], pixels[kept]


def _candidates(
    chunk: Tensor, reach: Tensor, centres: Tensor, homographies: Tensor, a: dict
) -> tuple[Tensor, Tensor, Tensor]:
    """Surfel, pixel and alpha of the fragments of some surfels that are strong enough."""
    side = torch.arange(-int(reach[chunk].max()), int(reach[chunk].max()) + 1)
    grid = torch.cartesian_prod(side, side)[None] + centres[chunk].floor().long()[:, None]  # [M, S, 2]
    inside = ((grid >= 0) & (grid < torch.tensor([a["width"], a["height"]]))).all(-1)
    row, cell = inside.nonzero(as_tuple=True)
    surfels, at = chunk[row], grid[row, cell]
    Tu, Tv, Tw = homographies[surfels].unbind(1)
    x, y = (at + 0.5).unbind(1)
    hit = torch.linalg.cross(x[:, None] * Tw - Tu, y[:, None] * Tw - Tv)
    rho = (hit[:, :2] / hit[:, 2:]).square().sum(1)
    filtered = a["options"].low_pass * (at + 0.5 - centres[surfels]).square().sum(1)
    alphas = a["opacities"][surfels] * torch.exp(-torch.minimum(rho, filtered) / 2)
    strong = alphas >= a["options"].alpha_min
    return surfels[strong], (at[:, 1] * a["width"] + at[:, 0])[strong], alphas[strong]
