"""The rasterizer against what else renders surfels on this machine, in the same run."""

from types import SimpleNamespace

import torch
from torch.nn.functional import pad

from benchmarks import gsplat_cpu, workload
from benchmarks.gsplat_cpu import LIKE_GSPLAT, OURS
from benchmarks.report import Measurement, Section
from benchmarks.settings import Settings
from benchmarks.timing import measure

PEER = "gsplat rasterization_2dgs"
OUTPUTS = ("normal", "median")  # what gsplat always renders besides the colour


def run(settings: Settings) -> Section:
    """Time gsplat's torch functions on a CPU, and gsplat on a GPU."""
    section = Section()
    if settings.device.type == "cuda":
        compare(settings, section)
    else:
        gsplat_cpu.compare(settings, section)
    return section


class Peer(workload.Workload):
    """A workload that gsplat's `rasterization_2dgs` renders on a GPU."""

    def image(self) -> SimpleNamespace:
        """Render without gradients."""
        with torch.no_grad():
            return self._render()

    def forward(self) -> None:
        """Render for `backward`."""
        for tensor in self.learned:
            tensor.grad = None
        self.render = self._render()

    def _render(self) -> SimpleNamespace:
        from gsplat import rasterization_2dgs

        a = self.arguments
        outputs = rasterization_2dgs(
            means=a["means"],
            quats=a["quats"],
            scales=pad(a["scales"], (0, 1), value=1.0),
            opacities=a["opacities"],
            colors=a["features"][None],  # [views, N, 3]: what has no views fails in gsplat 1.5.3
            viewmats=a["viewmat"][None],
            Ks=a["K"][None],
            width=a["width"],
            height=a["height"],
            near_plane=a["options"].near,
            far_plane=a["options"].far,
        )
        color, _, normal, _, _, median, _ = outputs
        return SimpleNamespace(color=color[0], normal=normal[0], median=median[0, ..., 0])


def compare(settings: Settings, section: Section) -> None:
    """Time forward, and forward + backward, of all scenes at the middle number of surfels."""
    try:
        from gsplat.cuda._backend import _C as compiled
    except (ImportError, RuntimeError) as error:
        section.skip(PEER, f"gsplat cannot be used: {error}; pip install '.[bench]'")
        return
    if compiled is None:
        section.skip(PEER, "gsplat's CUDA code is not compiled; put nvcc on the PATH")
        return
    cases, differences = [], []
    for scene in settings.scenes:
        at = (scene, settings.size, settings.n_surfels, settings.device)
        ours = workload.plain(*at, outputs=OUTPUTS, options=LIKE_GSPLAT)
        theirs = Peer(ours.arguments, ours.learned, workload.interleaved(ours.cotangents))
        for peer, made in ((PEER, theirs), (OURS, ours)):
            where = settings.where(scene=scene, peer=peer)
            cases += made.cases(where)
        difference = float((theirs.image().color - ours.image().color).abs().mean())
        where = settings.where(scene=scene, peer=PEER)
        differences.append(Measurement.of("mean difference of images", where, "1", [difference]))
    section.measurements += measure(cases, settings.rounds, settings.device, PEER) + differences
    section.add_ratios("peer", OURS, ("forward", "forward+backward"))
