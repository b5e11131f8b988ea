"""Common parts of methods that follow a picture: the picture, its object, and the losses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.edit.mask_keys import MASKS, mask_weights
from texgs.edit.method import MethodKeys
from texgs.edit.methods.segment import normalized_clicks

if TYPE_CHECKING:
    from torch import Tensor

    from texgs.edit.recipe import Recipe
    from texgs.edit.style_loop import Losses
    from texgs.edit.style_picture import Find, StylePicture
    from texgs.edit.task import EditedScene, Task
    from texgs.fields.field import Field
    from texgs.models.vgg import Vgg
    from texgs.volume.view_set import View


@dataclass(frozen=True)
class StyleKeys(MethodKeys):
    """The picture, and its object that counts."""

    style: str = key("strokes", "picture that texgs paints (strokes, glass, marble, ...), or a picture file")
    region: list[Any] = key([], "clicks on the object of the picture that counts, as shares; default all")
    masks: str = key("mobile_sam", "what finds that object; grabcut needs no weights", choices=MASKS)

    def check(self) -> None:
        """Require an existing picture, and clicks inside it."""
        require_picture(self.style, f"{self.node}.style")
        normalized_clicks(f"{self.node}.region", self.region)

    def weights(self) -> dict[str, str]:
        """Return the weights of the mask model, if it needs any."""
        return mask_weights(self.masks) if self.region else {}

    def files(self) -> dict[str, Path]:
        """Return the picture's file, unless it is one of texgs."""
        path = Path(self.style)
        return {"style": path} if path.is_file() else {}

    def followed(self) -> str:
        """Return the name of the picture."""
        return Path(self.style).name

    def picture(self) -> StylePicture | None:
        """Read the picture, restricted to the object that was clicked on."""
        import torch

        from texgs.models.sam import mask_model

        def find(image: Tensor) -> Tensor:
            height, width = image.shape[:2]
            clicks = normalized_clicks(f"{self.node}.region", self.region)
            points = torch.tensor(clicks) * torch.tensor([width, height])
            masks = mask_model(self.masks, torch.device("cpu"))
            return masks(image, points, torch.ones(len(points), dtype=torch.bool))

        return picture_of(self.style, f"{self.node}.style", find if self.region else None)


@dataclass(frozen=True)
class FeatureKeys(StyleKeys):
    """How views are compared with the style."""

    nnfm: float = key(1.0, "weight of NNFM on VGG-16; 0 needs no weights", least=0)
    patches: float = key(0.0, "weight of the sliced Wasserstein distance of patches", least=0)
    foreground: bool = key(True, "only what is on the object counts, not what is behind")
    sampled: bool = key(False, "features are drawn at random and searched roughly, for CPUs")

    def check(self) -> None:
        """Require a picture, and at least one loss."""
        if not self.nnfm and not self.patches:
            raise ArgumentError(
                f"{self.node}.nnfm, {self.node}.patches: expected a weight above 0 for one of them, got 0 "
                "for both"
            )
        super().check()

    def weights(self) -> dict[str, str]:
        """Return VGG if features are compared, and the weights of the mask model."""
        without = "nnfm=0" if self.patches else ""
        return {**({"vgg16": without} if self.nnfm > 0 else {}), **super().weights()}

    def stylize(self, work: StyleWork, name: str, model: Any, views: Sequence[View]) -> tuple[Any, Losses]:
        """Stylize a model on training views; return it with the losses."""
        raise NotImplementedError

    def recipe(self, iterations: int, seed: int, **changes: Any) -> Recipe:
        """Return a `Recipe` with these losses and other changes."""
        from texgs.edit.recipe import Recipe

        exact: dict[str, Any] = {} if self.sampled else dict.fromkeys(("queries", "positions", "dimensions"))
        return Recipe(
            iterations=iterations,
            features=self.nnfm,
            distribution=0.0,
            patches=self.patches,
            behind="white",
            cropped=False,
            foreground=self.foreground,
            seed=seed,
            **exact,
            **changes,
        )


@dataclass(frozen=True, eq=False)
class StyleWork:
    """Pictures for the parts of a scene, with losses and notes for the report."""

    task: Task[Any]
    vgg: Vgg | None
    pictures: dict[str, StylePicture] = field(default_factory=dict)  # by part
    losses: dict[str, Losses] = field(default_factory=dict)  # by part
    notes: dict[str, Any] = field(default_factory=dict)

    def picture(self, part: str) -> StylePicture:
        """Return the picture that a part follows."""
        picture = self.task.settings_for(part).picture()
        assert picture is not None
        self.pictures[part] = picture
        return picture

    def write_pictures(self) -> dict[str, str]:
        """Write style.png, or one per part if pictures differ; return descriptions."""
        import torch

        from texgs.core.image import write_png
        from texgs.core.names import style_file

        pictures = self.pictures
        first, *others = (picture.image for picture in pictures.values())
        if all(torch.equal(first, other) for other in others):
            pictures = {"": next(iter(pictures.values()))}
        shown = {}
        for name, picture in pictures.items():
            file = style_file(name)
            write_png(self.task.output / file, picture.image.permute(1, 2, 0))
            shown[file] = f"The style picture{f' of {name}' if name else ''}."
        return shown


def run(task: Task[FeatureKeys]) -> EditedScene:
    """Give the models the style; write style.png."""
    from texgs.edit.task import EditedScene
    from texgs.models.vgg import Vgg

    keys = task.settings
    work = StyleWork(task, Vgg.load(device=task.device) if keys.nnfm > 0 else None)

    def one(name: str, model: Field, views: Sequence[View]) -> Field:
        edited: Field
        edited, work.losses[name] = keys.stylize(work, name, model, views)
        return edited

    scene = task.each_model(one)
    how = " + ".join(["VGG-16"] * (keys.nnfm > 0) + ["patches"] * (keys.patches > 0))
    return EditedScene(scene, how, work.write_pictures(), notes=work.notes, losses=work.losses)


def picture_of(name: str, key: str, find: Find | None = None) -> StylePicture:
    """Read a picture of texgs by name, or a picture file; `key` is named in errors.

    Only the region that `find` returns counts, see `read_style`; by default all.
    """
    from texgs.edit.style_picture import StylePicture, read_style
    from texgs.models.pictures import PICTURES, picture

    if name in PICTURES:
        image = picture(name)
        return StylePicture.of(image, None if find is None else find(image.permute(1, 2, 0)))
    if not Path(name).exists():
        raise ArgumentError(
            f"{key}: no such file as {name!r}; expected that of a picture, or one of {', '.join(PICTURES)}"
        )
    return read_style(name, find)


def require_picture(name: str, key: str) -> None:
    """Require a picture of texgs, or a readable picture file."""
    from texgs.models.pictures import PICTURES

    if name not in PICTURES:
        picture_of(name, key)
