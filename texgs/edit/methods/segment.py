"""2D-lift-3D segmentation (the paper's section Partial editing): clicks on a view make a part of a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError, ConfigError
from texgs.core.keys import key
from texgs.core.lens import Lens, frequency_of
from texgs.core.names import require_name
from texgs.edit.mask_keys import MASKS, MaskKeys, mask_weights
from texgs.edit.method import Method, MethodKeys

if TYPE_CHECKING:
    import torch

    from texgs.core.camera import Camera
    from texgs.edit.clicks import Clicks
    from texgs.edit.new_segment import Segmented
    from texgs.edit.task import EditedScene, Task
    from texgs.fields.surfels.model import Surfels

CAPTION = (
    "Clicks with the mask of their view. Most views agree on the segment; the rest of the model is faint."
)
CONNECTED_WORDS = " Of what is in the masks, only pieces that hold a click belong to it (connected=true)."
DIM_OPACITY = 0.15  # opacity outside the segment, in its picture


@dataclass(frozen=True)
class SegmentKeys(MethodKeys, MaskKeys):
    """The clicks, and how masks select surfels."""

    model: str = key("", "model whose part it is; may be left out where there is one")
    name: str = key("part", "name of the segment")
    view: list[float] = key([30.0, 20.0], "azimuth and polar angle of the view clicked on", "degrees")
    # OmegaConf takes no integers for list[list[float]].
    points: list[Any] = key([], "clicks on the part: right and down, as shares of the view's sides")
    others: list[Any] = key([], "clicks on what does not belong to it")
    masks: str = key("mobile_sam", "what finds the part in a view; grabcut needs no weights", choices=MASKS)
    voters: str = key(
        "icosphere",
        "views that vote: some around the object, or those of training, as in the paper",
        choices=("icosphere", "training"),
    )

    def places(self) -> list[list[float]]:
        """Return the clicks as shares of the view's sides, those off the part last."""
        places = normalized_clicks("edit.segment.points", [*self.points, *self.others])
        if not self.points:
            raise ArgumentError("edit.segment.points: expected one at least, such as [[0.5, 0.4]], got none")
        if len(self.view) != 2:
            raise ArgumentError(f"edit.segment.view: expected azimuth and polar angle, got {self.view}")
        return places

    def check(self) -> None:
        """Require a name, clicks, and the view count of an icosphere."""
        require_name(self.name, "edit.segment.name")
        self.places()
        frequency_of(self.views, "edit.segment.views")

    def weights(self) -> dict[str, str]:
        """Return the weights of the mask model."""
        return mask_weights(self.masks)

    def adds(self, models: Sequence[str]) -> Sequence[str]:
        """Return the name of the segment."""
        model = self.model or (models[0] if len(models) == 1 else "")
        if model not in models:
            expected = f"expected one of {', '.join(models)}"
            raise ConfigError(f"edit.segment.model: {expected}, got {model or 'none'}")
        return [f"{model}/{self.name}"]


def run(task: Task[SegmentKeys]) -> EditedScene:
    """Make the segment; write its file, and edit.png with the clicks, their mask and the segment."""
    from texgs.core.names import part_file
    from texgs.edit.new_segment import model_name, new_segment
    from texgs.edit.task import EditedScene
    from texgs.scene.session import Session

    settings, session = task.settings, Session(task.scene)
    name = model_name(task.scene, settings.model, "edit.segment.model")
    clicks = clicks_of(settings, task.lens, task.device)
    made = new_segment(
        *(session, f"{name}/{settings.name}", clicks, settings, task.lens),
        lambda: task.output / part_file("edit.segment.name", name, settings.name),
        {},
        cameras=voters(task, name),
        title=f"{task.title} {task.edit.name}",
    )
    show(task, clicks, made)
    return EditedScene(
        session.scene,
        f"{settings.masks}, {settings.vote}",
        {"edit.png": CAPTION + CONNECTED_WORDS * settings.connected},
        notes={
            "surfels": int(made.lifted.mask.sum()),
            "views": {"used": made.lifted.used, "left out": made.lifted.left_out},
        },
    )


def voters(task: Task[SegmentKeys], model: str) -> list[Camera]:
    """Return the cameras of the training views that vote on a model; none if other views vote."""
    from texgs.volume.images import smaller

    if task.settings.voters != "training":
        return []
    return [smaller(view.camera, task.reduce) for view in task.training_views(model)]


def clicks_of(settings: SegmentKeys, lens: Lens, device: torch.device) -> Clicks:
    """Return clicks in pixels of a lens's image."""
    import torch

    from texgs.core.camera import orbit
    from texgs.edit.clicks import Clicks

    places, (azimuth, polar) = settings.places(), settings.view
    camera = orbit(azimuth, polar, *lens).to(device)
    points = lens.width * torch.tensor(places, dtype=torch.float32, device=device)
    positive = torch.arange(len(points), device=device) < len(settings.points)
    return Clicks(camera, points, positive)


def show(task: Task[SegmentKeys], clicks: Clicks, made: Segmented) -> None:
    """Write edit.png: the clicked view with its mask, and views of the segment with the rest dimmed."""
    import torch

    from texgs.core.figures import write_grid
    from texgs.edit.new_segment import overlay
    from texgs.fields.surfels.model import Surfels
    from texgs.volume.cameras import sights

    model, lifted = made.model, made.lifted
    faint = lifted.mask.new_ones(len(model), dtype=torch.float32).masked_fill(~lifted.mask, DIM_OPACITY)
    opacities = (model.parameters["opacities"].sigmoid() * faint).clamp(1e-6, 1 - 1e-6).logit()
    dimmed = Surfels({**model.parameters, "opacities": opacities}, model.shading, model.metadata)

    @torch.no_grad()
    def shown(of: Surfels, camera: Camera) -> torch.Tensor:
        return of.render(camera.to(task.device), task.scene.light).color.clamp(0, 1)

    marked = overlay(shown(model, clicks.camera), lifted.reference, clicks)
    around = {"segment": clicks.camera, **sights(task.lens)}
    pictures = [marked, *(shown(dimmed, camera) for camera in around.values())]
    titles = ["clicks and mask", *around]
    write_grid(task.output / "edit.png", {"": [image.cpu().numpy() for image in pictures]}, titles)


METHOD = Method(
    "segment",
    "make a segment of a model of a scene, by clicks of the configuration",
    SegmentKeys,
    run,
    needs=frozenset({"segments"}),
    is_look=False,
)


def normalized_clicks(name: str, points: Sequence[Any]) -> list[list[float]]:
    """Return clicks as shares of the sides of a picture, checked."""
    for point in points:
        is_pair = isinstance(point, list) and len(point) == 2
        if not is_pair or not all(isinstance(x, int | float) and 0 <= x < 1 for x in point):
            raise ArgumentError(f"{name}: expected two shares from 0 to below 1, got {point}")
    return list(points)
