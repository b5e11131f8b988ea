"""Stages `edit_METHOD`: a method of editing gives a scene a new look, or a new part."""

from pathlib import Path
from typing import Any

from texgs.cli.stages.outcome import Outcome
from texgs.config.edit import EditKeys
from texgs.config.methods import method_of
from texgs.config.typed import typed
from texgs.core.device import torch_device
from texgs.core.lens import Lens
from texgs.edit.task import Task
from texgs.report.before_after import write_before_and_after
from texgs.report.results import EditResult
from texgs.scene.scene_file import read_scene, write_scene

SHOWN = "Before and after the edit, under the light of the scene and under another one."
VIEWS = "views."  # before the name of a model, in the names of inputs


def work(settings: dict[str, Any], inputs: dict[str, Path], output: Path) -> Outcome:
    """Write scene.yaml, edit.png, what the method writes, and turntable.mp4 where the scene looks different.

    Args:
        settings: what the stage reads of the configuration.
        inputs: `scene`, and for each model `views.MODEL`, the transforms_train.json of its views.
        output: folder.
    """
    method, title = method_of(settings["edit"]), f"{settings['dataset']}: edit"
    device, before = torch_device(settings["fit"]["device"]), read_scene(inputs["scene"])
    common = {name: value for name, value in settings["edit"].items() if name != method.name}
    task = Task(
        method.of(settings["edit"]),
        typed(EditKeys, common),
        before,
        {name.removeprefix(VIEWS): path for name, path in inputs.items() if name.startswith(VIEWS)},
        output,
        device,
        settings["reduce"],
        settings["clip"],
        settings["weights"],
        title,
    )
    edited = method.run(task)
    write_scene(output / "scene.yaml", edited.scene)
    pictures = dict(edited.pictures)
    if method.is_look:
        write_before_and_after(before, edited.scene, Lens(**settings["lens"]), output, device, title)
        pictures["edit.png"] = SHOWN
    result = EditResult(
        task.edit.name, method.name, edited.how, edited.seconds, edited.lambda_s, dict(edited.notes)
    )
    return Outcome(result, pictures)
