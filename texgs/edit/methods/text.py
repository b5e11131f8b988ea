"""Text-driven editing of textures (the paper's section Text-Driven NPSE)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from texgs.core.keys import key
from texgs.edit.method import Method
from texgs.edit.methods.instruction import SHOWN_VIEWS, InstructionKeys, write_views
from texgs.edit.readable import ReadableKeys, highlights_of, raise_opacities

if TYPE_CHECKING:
    import numpy as np
    from torch import Tensor

    from texgs.edit.task import EditedScene, Task
    from texgs.edit.text import TextRecipe
    from texgs.fields.surfels.model import Surfels
    from texgs.volume.view_set import View


@dataclass(frozen=True)
class TextKeys(ReadableKeys, InstructionKeys):
    """The instruction, the editor of the views, and how texels follow."""

    recipe: str = key(
        "default",
        "how texels follow: solved for the colours of edited views, quickly at one opacity; or as in the "
        "paper, by iterations to the edited images themselves",
        choices=("default", "quick", "paper"),
    )
    views: str | None = key(
        None,
        "views that are edited: new ones along the axes, which the scene fills; the six training views "
        "nearest to the axes, as in the paper; or all training views; default the recipe's",
        choices=("axes", "nearest", "all"),
    )
    textured: bool = key(True, "each texel follows, or each surfel's one colour: the paper's ablation")
    material: bool | None = key(
        None,
        "an instruction that names a material, such as gold, sets its highlights too; default the recipe's",
    )
    size: int = key(512, "longer side of the six views", "pixels", least=64)

    def recipe_of(self) -> TextRecipe:
        """Return the recipe with the changes from the configuration."""
        from texgs.edit.text import RECIPES

        recipe = replace(RECIPES[self.recipe], is_textured=self.textured)
        chosen: dict[str, Any] = {"views": self.views, "material": self.material}
        return replace(recipe, **{name: value for name, value in chosen.items() if value is not None})

    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the recipe."""
        return vars(self.recipe_of())


def run(task: Task[TextKeys]) -> EditedScene:
    """Give the parts the look; write views.png with the edited views."""
    from texgs.edit.task import EditedScene
    from texgs.edit.text import edit_by_text

    task = raise_opacities(task)
    settings, guidance = task.settings, task.settings.opened(task.device)
    rows: dict[str, list[np.ndarray]] = {}
    seen: dict[str, float] = {}

    def one(name: str, model: Surfels, surfels: Tensor | None, views: Sequence[View]) -> Surfels:
        result = edit_by_text(
            model,
            task.cameras_of(views),
            *(guidance, task.settings_for(name).instruction, settings.recipe_of()),
            light=task.scene.light,
            opacity=task.opacity_of(name),
            hue=task.hue_of(name, surfels),
            surfels=surfels,
            steps=task.other_steps(name),
            size=settings.size,
            seed=task.edit.seed,
            title=task.title_of(name),
        )
        seen[name] = result.seen
        rows[f"{name} before"] = [image.cpu().numpy() for image in result.views.images[:SHOWN_VIEWS]]
        rows[f"{name} edited"] = [image.cpu().numpy() for image in result.images[:SHOWN_VIEWS]]
        return result.model

    def highlights(name: str, model: Surfels, surfels: Tensor | None) -> dict[str, Any]:
        followed = task.settings_for(name).instruction
        given = highlights_of(followed, model, surfels) if settings.recipe_of().material else {}
        return {name: x for name, x in given.items() if name != "tint" or settings.hue == 1}

    scene = task.each_part(one, highlights)
    return EditedScene(
        scene,
        f"{guidance.name}, {settings.recipe}" + ("" if settings.textured else ", without texture"),
        write_views(task.output, rows) if task.draws else {},
        notes={"instruction": task.followed or settings.instruction, "seen": seen},
    )


METHOD = Method(
    "text",
    "give a scene the look that an instruction asks for",
    TextKeys,
    run,
    needs=frozenset({"texture", "relight"}),
    follows="instruction",
)
