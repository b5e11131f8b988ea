"""What methods share that follow a picture: which picture, and which object of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.edit.method import Method
from texgs.edit.methods.normalized_clicks import MASKS, mask_weights, shares

if TYPE_CHECKING:
    from torch import Tensor

    from texgs.edit.recipe import Recipe
    from texgs.edit.style_picture import Find, StylePicture
    from texgs.edit.task import EditedScene, Task
    from texgs.models.vgg import Vgg
    from texgs.scene.scene import Scene


@dataclass(frozen=True)
class StyleKeys:
    """The picture, and the object of it that counts."""

    style: str = key("strokes", "picture that texgs paints (strokes, glass, marble, ...), or a picture file")
    region: list[Any] = key([], "clicks on the object of the picture that counts, as shares; default all")
    masks: str = key("mobile_sam", "what finds that object; grabcut needs no weights", choices=MASKS)


@dataclass(frozen=True)
class FeatureKeys(StyleKeys):
    """How views that learn the style are compared with it."""

    nnfm: float = key(1.0, "weight of NNFM on VGG-16; 0 needs no weights", least=0)
    patches: float = key(0.0, "weight of the sliced Wasserstein distance of patches", least=0)
    foreground: bool = key(True, "only what is on the object counts, not what is behind")
    sampled: bool = key(False, "features are drawn at random and searched roughly, for CPUs")

    def recipe(self, iterations: int, seed: int, reduce: int) -> Recipe:
        """Its losses, for features that see averages of `reduce` pixels each way."""
        from texgs.edit.recipe import DEFAULT, Recipe

        drawn = (DEFAULT.queries, DEFAULT.positions, DEFAULT.dimensions) if self.sampled else (None,) * 3
        queries, positions, dimensions = drawn
        return Recipe(
            iterations=iterations,
            features=self.nnfm,
            distribution=0.0,
            patches=self.patches,
            behind="white",
            cropped=False,
            foreground=self.foreground,
            queries=queries,
            positions=positions,
            dimensions=dimensions,
            reduce=reduce,
            seed=seed,
        )

    def weights(self) -> dict[str, str]:
        """VGG where features are compared, and what finds the object."""
        without = "nnfm=0" if self.patches else ""
        return {**({"vgg16": without} if self.nnfm > 0 else {}), **weights(self)}

    @property
    def how(self) -> str:
        """What the edit works with, for tables."""
        used = {"VGG-16": self.nnfm > 0, "patches": self.patches > 0}
        return " + ".join(name for name, is_used in used.items() if is_used)


Keys = TypeVar("Keys", bound=FeatureKeys)


@dataclass(frozen=True, eq=False)
class Look:
    """Pictures on their way onto the models of a scene, and how the losses fell."""

    task: Task[Any]
    vgg: Vgg | None
    pictures: dict[str, StylePicture] = field(default_factory=dict)  # by model
    losses: dict[str, dict[str, list[float]]] = field(default_factory=dict)  # by model and term

    @classmethod
    def of(cls, task: Task[Any]) -> Look:
        """What an edit with `FeatureKeys` follows."""
        from texgs.models.vgg import Vgg

        vgg = Vgg.load(device=task.device) if task.settings.nnfm > 0 else None
        return cls(task, vgg)

    def picture(self, model: str) -> StylePicture:
        """What a model follows."""
        method = self.task.edit.method
        self.pictures[model] = style_of(self.task.settings_for(model), f"edit.{method}")
        return self.pictures[model]

    def title(self, model: str) -> str:
        """Of a progress bar."""
        return f"{self.task.title} {self.task.edit.name}, {model}"

    def result(self, scene: Scene) -> EditedScene:
        """The edited scene; writes its style pictures."""
        from texgs.edit.task import EditedScene

        pictures = write_styles(self.task.output, self.pictures)
        return EditedScene(scene, self.task.settings.how, pictures, losses=self.losses)


def write_styles(folder: Path, pictures: Mapping[str, StylePicture]) -> dict[str, str]:
    """Write style.png, or one for each model where they follow different pictures; what they show."""
    import torch

    from texgs.core.image import write_png

    first, *others = (picture.image for picture in pictures.values())
    if all(torch.equal(first, other) for other in others):
        pictures = {"": next(iter(pictures.values()))}
    shown = {}
    for name, picture in pictures.items():
        file = f"style-{name.replace('/', '-')}.png" if name else "style.png"
        write_png(folder / file, picture.image.permute(1, 2, 0))
        shown[file] = f"The style picture{f' of {name}' if name else ''}."
    return shown


def look_method(
    name: str, summary: str, settings: type[Keys], run: Callable[[Task[Keys]], EditedScene], field: str
) -> Method[Keys]:
    """The specification of a method that gives a kind of field the style of a picture."""
    where = f"edit.{name}"

    def checked(values: Keys) -> None:
        if not values.nnfm and not values.patches:
            raise ArgumentError(
                f"{where}.nnfm, {where}.patches: expected a weight above 0 for one of them, got 0 for both"
            )
        check(values, where)

    return Method(
        name,
        summary,
        settings,
        run,
        checked,
        lambda values: values.weights(),
        fields=frozenset({field}),
        files=files,
        style=lambda values: style_of(values, where),
        follows="style",
        followed=lambda values: Path(values.style).name,
    )


def files(settings: StyleKeys) -> dict[str, Path]:
    """The picture's file, where it is one."""
    path = Path(settings.style)
    return {"style": path} if path.is_file() else {}


def weights(settings: StyleKeys) -> dict[str, str]:
    """What finds the object, where that needs weights."""
    return mask_weights(settings.masks) if settings.region else {}


def picture_of(name: str, key: str, find: Find | None = None) -> StylePicture:
    """The picture of texgs that has this name, or of a file; `key` is where it stands: edit.image.style.

    Args:
        name: or path.
        key: that it is the value of.
        find: returns the part that counts, see `read_style`; by default all.
    """
    from texgs.edit.pictures import PICTURES, picture
    from texgs.edit.style_picture import StylePicture, read_style

    if name in PICTURES:
        image = picture(name)
        return StylePicture.of(image, None if find is None else find(image.permute(1, 2, 0)))
    if not Path(name).exists():
        raise ArgumentError(
            f"{key}: expected the file of a picture, or one of {', '.join(PICTURES)}; got {name!r}"
        )
    return read_style(name, find)


def check(settings: StyleKeys, where: str) -> None:
    """Require a picture that is there, and clicks on it."""
    from texgs.edit.pictures import PICTURES

    if settings.style not in PICTURES:
        picture_of(settings.style, f"{where}.style")
    shares(f"{where}.region", settings.region)


def style_of(settings: StyleKeys, where: str) -> StylePicture:
    """The picture, of it the object that was clicked on."""
    import torch

    from texgs.models.masks import mask_model

    def find(image: Tensor) -> Tensor:
        height, width = image.shape[:2]
        points = torch.tensor(shares(f"{where}.region", settings.region)) * torch.tensor([width, height])
        masks = mask_model(settings.masks, torch.device("cpu"))
        return masks(image, points, torch.ones(len(points), dtype=torch.bool))

    return picture_of(settings.style, f"{where}.style", find if settings.region else None)
