"""Stage `edit_image`: the parts of a scene take on the style of a picture."""

import sys
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from texgs.cli.segments import mask_model
from texgs.cli.stages.before_after import show
from texgs.cli.stages.outcome import Outcome
from texgs.cli.stages.parts import edit_parts, shares, views_of
from texgs.core.device import torch_device
from texgs.core.errors import ArgumentError
from texgs.core.image import write_png
from texgs.edit.clip_loss import ClipLoss
from texgs.edit.pictures import PICTURES, picture
from texgs.edit.recipe import Recipe, preset
from texgs.edit.style_picture import StylePicture, read_style
from texgs.edit.stylize import stylize
from texgs.fields.surfels.model import Surfels
from texgs.models.clip import Clip
from texgs.models.vgg import Vgg
from texgs.report.convergence import write_convergence
from texgs.scene.scene_file import read_scene, write_scene
from texgs.volume.reduced import smaller


def work(settings: dict[str, Any], inputs: dict[str, Path], output: Path) -> Outcome:
    """Write scene.yaml, a texture for each part, style.png, edit.png, convergence.png and turntable.mp4.

    Args:
        settings: what the stage reads of the configuration.
        inputs: `scene`, and for each model `views.MODEL`, the transforms_train.json of its views.
        output: folder.
    """
    edit, image, title = settings["edit"], settings["edit"]["image"], f"{settings['dataset']}: edit"
    device, scene = torch_device(settings["fit"]["device"]), read_scene(inputs["scene"])
    recipe, style = with_what_is_there(recipe_of(image, edit["seed"]), settings), style_of(image)
    pixels = style.image.permute(1, 2, 0)
    write_png(output / "style.png", pixels)
    vgg = Vgg.load(device=device) if recipe.needs_vgg else None
    clip = ClipLoss(Clip.load(settings["clip"], device), pixels.to(device)) if recipe.needs_clip else None
    curves: dict[str, dict[str, list[float]]] = {}

    def one(name: str, model: Surfels, surfels: Tensor | None) -> tuple[Surfels, dict[str, Any]]:
        views = views_of(inputs, name)
        start = time.monotonic()
        result = stylize(
            model,
            [smaller(view.camera, settings["reduce"]) for view in views],
            [view.light for view in views],
            style,
            recipe,
            vgg=vgg,
            clip=clip,
            surfels=surfels,
            title=f"{title} {edit['name']}, {name}",
        )
        curves[name] = result.history.losses
        return result.model, {"seconds": time.monotonic() - start, "by_part": result.history.seconds}

    after, found = edit_parts(scene, edit["parts"], output, device, one)
    write_scene(output / "scene.yaml", after)
    drawn = [write_convergence(output / "convergence.png", curves)]
    numbers = {
        "edit": edit["name"],
        "kind": "image",
        "method": method(recipe, wanted=recipe_of(image, edit["seed"])),
        "lambda_s": recipe.lambda_s if recipe.needs_vgg or recipe.needs_clip else None,
        "edit_seconds": sum(each["seconds"] for each in found.values()),
        "parts": found,
    }
    return Outcome(numbers, [*show(scene, after, output, device, title), *drawn])


def recipe_of(image: dict[str, Any], seed: int) -> Recipe:
    """The recipe of an edit, with what the configuration changes about it."""
    changes = {key: image[key] for key in ("iterations", "lambda_s", "start") if image[key] is not None}
    kept = {"pattern": image["pattern"], "is_textured": image["textured"], "seed": seed}
    return preset(image["recipe"], **kept, **changes)


def with_what_is_there(recipe: Recipe, settings: Mapping[str, Any]) -> Recipe:
    """The recipe with lambda_s 1 where CLIP's weights are missing and nobody has asked for another value."""
    is_asked = settings["edit"]["image"]["lambda_s"] is not None
    if not recipe.needs_clip or is_asked or settings["weights"][settings["clip"]] is not None:
        return recipe
    sys.stderr.write(f"the weights of {settings['clip']} are not on this machine: lambda_s is 1\n")
    return replace(recipe, lambda_s=1.0)


def style_of(image: Mapping[str, Any]) -> StylePicture:
    """The picture of texgs that has this name, or of a file; of it the object that was clicked on."""
    style = picture_of(image["style"])
    if not image["region"]:
        return style
    height, width = style.region.shape
    points = torch.tensor(shares("edit.image.region", image["region"])) * torch.tensor([width, height])
    positive = torch.ones(len(points), dtype=torch.bool)
    masks = mask_model(image["masks"], torch.device("cpu"))
    return StylePicture.of(style.image, masks(style.image.permute(1, 2, 0), points, positive) & style.region)


def picture_of(name: str) -> StylePicture:
    """The picture of texgs that has this name, or of a file.

    Raises:
        ArgumentError: if there is neither, or the file holds no picture that can be used.
    """
    if name in PICTURES:
        return StylePicture.of(picture(name))
    if not Path(name).exists():
        raise ArgumentError(
            f"edit.image.style: expected the file of a picture, or one of {', '.join(PICTURES)}; got {name!r}"
        )
    return read_style(name)


def method(recipe: Recipe, wanted: Recipe) -> str:
    """What the edit works with, for tables; and that CLIP is missing, where a recipe wants it."""
    names = {
        "VGG-16": recipe.needs_vgg,
        "CLIP": recipe.needs_clip,
        "patches": recipe.patches > 0 and recipe.iterations > 0,
    }
    found = [name for name, is_used in names.items() if is_used] or ["projection"]
    words = " + ".join(found) + ("" if recipe.needs_vgg or recipe.needs_clip else " (no weights)")
    words += " without CLIP, its weights are missing" if wanted.needs_clip and not recipe.needs_clip else ""
    return words if recipe.is_textured else f"{words}, without texture"
