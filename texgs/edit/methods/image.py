"""Image-driven editing of textures (the paper's section Image-Driven NPSE): the style of a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from texgs.core.keys import key
from texgs.edit.method import Method
from texgs.edit.methods.style import StyleKeys, StyleWork
from texgs.edit.readable import ReadableKeys, raise_opacities
from texgs.models.catalogue import CLIP_BACKBONES

if TYPE_CHECKING:
    from torch import Tensor

    from texgs.edit.recipe import Recipe
    from texgs.edit.task import EditedScene, Task
    from texgs.fields.surfels.model import Surfels
    from texgs.volume.view_set import View


@dataclass(frozen=True)
class ImageKeys(ReadableKeys, StyleKeys):
    """How texels take on a style."""

    recipe: str = key(
        "default",
        "default; patches, which needs no weights; preview, the picture laid onto the surface; paper, NNFM "
        "and CLIP from random colours",
        choices=("default", "patches", "preview", "paper"),
    )
    iterations: int | None = key(None, "steps, of one view each; default the recipe's", least=0)
    lambda_s: float | None = key(
        None, "share of NNFM, the rest is CLIP; default the recipe's", least=0, most=1
    )
    clip: str = key(
        CLIP_BACKBONES[0],
        "backbone of the CLIP term, where lambda_s is below 1; metrics have their own",
        choices=CLIP_BACKBONES,
    )
    pattern: float | None = key(
        None, "size of the style's pattern, as a multiple of the views' size; default the recipe's", above=0
    )
    start: str | None = key(
        None,
        "colours at the start: the picture laid onto the surface, or by normals where it shows a lit sphere, "
        "its mean, random pixels of it, or the model's own moved to its colours; default the recipe's",
        choices=("projected", "sphere", "mean", "random", "transfer"),
    )
    textured: bool = key(True, "each texel learns, or each surfel one colour: the paper's ablation")

    def recipe_of(self, seed: int = 0) -> Recipe:
        """Return the recipe with the changes from the configuration."""
        from texgs.edit.recipe import preset

        changes: dict[str, Any] = {"is_textured": self.textured, "seed": seed}
        for name in ("iterations", "lambda_s", "start", "pattern"):
            if (value := getattr(self, name)) is not None:
                changes[name] = value
        return preset(self.recipe, **changes)

    def weights(self) -> dict[str, str]:
        """Return the weights for the recipe, and for the mask model of the picture."""
        recipe = self.recipe_of()
        vgg = {"vgg16": "recipe=patches"} if recipe.needs_vgg else {}
        clip = {self.clip: "lambda_s=1"} if recipe.needs_clip else {}
        return {**vgg, **super().weights(), **clip}

    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the recipe."""
        return vars(self.recipe_of())


def run(task: Task[ImageKeys]) -> EditedScene:
    """Give the parts the style; write style.png."""
    import torch

    from texgs.edit.objective import ClipLoss
    from texgs.edit.stylize import stylize
    from texgs.edit.task import EditedScene
    from texgs.models.clip import Clip
    from texgs.models.vgg import Vgg

    task = raise_opacities(task)
    keys, recipe = task.settings, task.settings.recipe_of(task.edit.seed)
    dtype = torch.float32 if recipe.single_precision else None
    work = StyleWork(task, Vgg.load(device=task.device, dtype=dtype) if recipe.needs_vgg else None)
    network = Clip.load(keys.clip, task.device) if recipe.needs_clip else None
    seconds, adapted = dict[str, dict[str, float]](), list["Recipe"]()

    def one(name: str, model: Surfels, surfels: Tensor | None, views: Sequence[View]) -> Surfels:
        picture = work.picture(name)
        result = stylize(
            model,
            task.cameras_of(views),
            [task.scene.light] * len(views),
            picture,
            replace(recipe, opacity=task.opacity_of(name)),
            vgg=work.vgg,
            clip=ClipLoss(network, picture.image.permute(1, 2, 0).to(task.device)) if network else None,
            hue=task.hue_of(name, surfels),
            surfels=surfels,
            steps=task.other_steps(name),
            title=task.title_of(name),
            show=partial(task.show, name),
        )
        work.losses[name], seconds[name] = result.losses, result.seconds
        adapted.append(result.recipe)
        return result.model

    scene = task.each_part(one)
    share = recipe.lambda_s if recipe.needs_vgg or recipe.needs_clip else None
    words = how(adapted, network.name if network else keys.clip)
    return EditedScene(scene, words, work.write_pictures(), share, {"seconds": seconds}, work.losses)


def how(recipes: Sequence[Recipe], clip: str) -> str:
    """Describe the losses of an edit for tables; `clip` is the backbone of a CLIP term."""
    names = {
        "VGG-16": any(recipe.needs_vgg for recipe in recipes),
        clip: any(recipe.needs_clip for recipe in recipes),
        "patches": any(recipe.patches > 0 and recipe.iterations > 0 for recipe in recipes),
    }
    used = [name for name, is_used in names.items() if is_used] or ["projection"]
    words = " + ".join(used) + ("" if {"VGG-16", clip} & {*used} else " (no weights)")
    return words if recipes[0].is_textured else f"{words}, without texture"


METHOD = Method(
    "image",
    "give a scene the style of a picture",
    ImageKeys,
    run,
    needs=frozenset({"texture", "relight"}),
    follows="style",
)
