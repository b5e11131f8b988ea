"""The paper's baselines that keep editing training views while a field learns from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.edit.method import Method
from texgs.edit.methods.instruction import SHOWN_VIEWS, InstructionKeys, write_views
from texgs.edit.recipe import UpdateSchedule
from texgs.fitting.settings import CommonRates

if TYPE_CHECKING:
    import numpy as np

    from texgs.edit.dataset_update import Learner
    from texgs.edit.task import EditedScene, Task
    from texgs.fields.field import Field
    from texgs.volume.view_set import View


@dataclass(frozen=True)
class UpdateKeys(InstructionKeys):
    """How a field follows repeatedly edited views."""

    keeps_renders = (
        False  # whether edits stay close to renders of the fitted model instead of the training views
    )

    frozen: bool = key(False, "geometry stays as it is, bit for bit: the paper's second comparison")
    l1: float = key(0.8, "weight of the absolute difference to edited views", least=0)
    dssim: float = key(0.2, "weight of D-SSIM", least=0)
    lpips: float = key(0.0, "weight of LPIPS on VGG-16; 0 needs no weights", least=0)

    def schedule(self, views: int) -> UpdateSchedule:
        """Return the schedule of edits for a number of views."""
        raise NotImplementedError

    def learner(self, model: Any, images: Any, loss: Any, iterations: int) -> Learner:
        """Return a learner for a number of iterations on views."""
        raise NotImplementedError

    def check(self) -> None:
        """Require an instruction, a loss and a possible schedule."""
        super().check()
        if not (self.l1 or self.dssim or self.lpips):
            raise ArgumentError(
                f"{self.node}.l1, dssim, lpips: expected a weight above 0 for one of them, got 0 for all"
            )
        self.schedule(1)

    def weights(self) -> dict[str, str]:
        """Return the weights of the guidance, and of LPIPS if it is used."""
        return super().weights() | (dict.fromkeys(("vgg16", "lpips_vgg"), "lpips=0") if self.lpips else {})


def run(task: Task[UpdateKeys]) -> EditedScene:
    """Give the models the look; write views.png."""
    from texgs.edit.dataset_update import PhotometricLoss, update_field
    from texgs.edit.task import EditedScene
    from texgs.models.lpips import Lpips
    from texgs.volume.images import load

    keys, guidance = task.settings, task.settings.opened(task.device)
    lpips = Lpips.load(device=task.device, dtype=None) if keys.lpips else None
    loss = PhotometricLoss(keys.l1, keys.dssim, keys.lpips, lpips)
    rows: dict[str, list[np.ndarray]] = {}
    losses: dict[str, dict[str, list[float]]] = {}
    notes: dict[str, Any] = {}

    def one(name: str, model: Field, views: Sequence[View]) -> Field:
        images, plan = load(views, task.reduce), keys.schedule(len(views))
        updated = update_field(
            keys.learner(model, images, loss, plan.iterations),
            *(images, guidance),
            task.settings_for(name).instruction,
            plan,
            keeps_renders=keys.keeps_renders,
            seed=task.edit.seed,
            title=task.title_of(name),
        )
        before, after = zip(*updated.some(SHOWN_VIEWS), strict=True)
        rows[f"{name} before"] = [old.numpy() for old in before]
        rows[f"{name} edited"] = [new.numpy() for new in after]
        notes[name] = {"edits": updated.count, "seconds of them": updated.seconds}
        losses[name] = {"loss": updated.losses}
        return updated.learner.field

    scene = task.each_model(one)
    notes["instruction"] = task.followed or keys.instruction
    how = f"{guidance.name}, geometry {'frozen' if keys.frozen else 'learns'}"
    return EditedScene(scene, how, write_views(task.output, rows), notes=notes, losses=losses)


def noise_range(where: str, noise: Sequence[float]) -> tuple[tuple[float, float], ...]:
    """Check a range of noise levels, the same for all rounds."""
    if len(noise) != 2 or not 0 <= noise[0] <= noise[1] <= 1:
        raise ArgumentError(f"{where}: expected two shares from 0 to 1, the smaller one first, got {noise}")
    return ((noise[0], noise[1]),)


def rates_of_3dgs(zeroth: float, means_final: float) -> CommonRates:
    """Return the final rates of 3DGS, with two exceptions."""
    return CommonRates(1.6e-4, 0.001, 0.005, 0.05, zeroth, zeroth / 20, means_final, 1.0)


@dataclass(frozen=True)
class Igs2gsKeys(UpdateKeys):
    """Instruct-GS2GS (Vachha and Haque 2024): Gaussians learn from all views, edited one after another."""

    passes: int = key(3, "times that each view is edited", least=1)
    every: int = key(2500, "iterations from pass to pass", least=1)
    noise: list[float] = key([0.7, 0.98], "level of noise of an edit, from and to, as a share")
    rates: CommonRates = key(rates_of_3dgs(0.0025, 0.01), "learning rates")

    def schedule(self, views: int) -> UpdateSchedule:
        """Edit all views in passes, and learn from each after its edit."""
        levels = noise_range("edit.igs2gs.noise", self.noise)
        return UpdateSchedule(self.passes, self.every, learned="newest", levels=levels)

    def learner(self, model: Any, images: Any, loss: Any, iterations: int) -> Any:
        """Return Gaussians with Adam."""
        from texgs.edit.gaussians import GaussianLearner

        return GaussianLearner(model, images, loss, iterations, self.rates, self.frozen)


@dataclass(frozen=True)
class DgeKeys(UpdateKeys):
    """DGE (Chen et al. 2024): in each round Gaussians learn from some views that are edited together."""

    keeps_renders = True

    l1: float = key(10.0, "weight of the absolute difference to edited views", least=0)
    dssim: float = key(0.0, "weight of D-SSIM", least=0)
    lpips: float = key(10.0, "weight of LPIPS on VGG-16; 0 needs no weights", least=0)
    rounds: int = key(3, "rounds of edits", least=1)
    every: int = key(500, "iterations of a round", least=1)
    views: int = key(20, "views edited in a round, drawn at random", least=1)
    noise: list[float] = key(
        [0.998, 0.3, 0.3, 0.021], "levels of noise of the rounds' edits, as shares; the last one holds on"
    )
    prune: bool = key(True, "Gaussians that are faint or large are removed, if geometry learns")
    rates: CommonRates = key(rates_of_3dgs(0.0125, 0.1), "learning rates")

    def schedule(self, views: int) -> UpdateSchedule:
        """Edit some views together in each round, and learn from nothing but them."""
        if not self.noise or not all(0 <= level <= 1 for level in self.noise):
            raise ArgumentError(f"edit.dge.noise: expected one share from 0 to 1 at least, got {self.noise}")
        levels = tuple((level, level) for level in self.noise)
        return UpdateSchedule(self.rounds, self.every, self.views, self.views, "random", "round", levels)

    def learner(self, model: Any, images: Any, loss: Any, iterations: int) -> Any:
        """Return Gaussians with Adam and pruning."""
        from texgs.edit.gaussians import GaussianLearner

        return GaussianLearner(model, images, loss, iterations, self.rates, self.frozen, self.prune)


@dataclass(frozen=True)
class In2nKeys(UpdateKeys):
    """Instruct-NeRF2NeRF (Haque et al. 2023): one view is edited at a time, patches of all are learned."""

    l1: float = key(1.0, "weight of the absolute difference to edited views", least=0)
    dssim: float = key(0.0, "weight of D-SSIM, which patches have not", least=0, most=0)
    lpips: float = key(1.0, "weight of LPIPS on VGG-16; 0 needs no weights", least=0)
    passes: float = key(3.0, "times that each view is edited", above=0)
    every: int = key(10, "iterations between edits", least=1)
    noise: list[float] = key([0.02, 0.98], "level of noise of an edit, from and to, as a share")
    patches: int = key(16, "patches that an iteration learns from", least=1)
    side: int = key(32, "side of a patch", "pixels", least=16)
    density: float = key(0.05, "learning rate of densities", least=0)
    sh: float = key(0.01, "learning rate of spherical harmonics", least=0)

    def schedule(self, views: int) -> UpdateSchedule:
        """Edit one view after the other."""
        rounds = max(1, round(self.passes * views))
        return UpdateSchedule(rounds, self.every, views=1, levels=noise_range("edit.in2n.noise", self.noise))

    def learner(self, model: Any, images: Any, loss: Any, iterations: int) -> Any:
        """Return a grid that learns from patches."""
        from texgs.edit.voxels import VoxelLearner, VoxelRates

        rates = VoxelRates(0.0 if self.frozen else self.density, self.sh, self.sh)
        return VoxelLearner(model, loss, rates, self.patches, self.side)


METHOD = tuple(
    Method(
        *(name, f"edit {what} by an instruction, as {paper} does", keys, run),
        fields=frozenset({field}),
        follows="instruction",
    )
    for name, what, paper, keys, field in (
        ("dge", "some views of a scene of 3D Gaussians together", "DGE", DgeKeys, "gaussians"),
        ("igs2gs", "all views of a scene of 3D Gaussians in turn", "Instruct-GS2GS", Igs2gsKeys, "gaussians"),
        ("in2n", "views of a scene of voxels one by one", "Instruct-NeRF2NeRF", In2nKeys, "voxels"),
    )
)
