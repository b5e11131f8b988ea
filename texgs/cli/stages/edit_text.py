"""Stage `edit_text`: the parts of a scene look as an instruction says."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from texgs.cli.stages.before_after import show
from texgs.cli.stages.outcome import Outcome
from texgs.cli.stages.parts import edit_parts, views_of
from texgs.core.device import torch_device
from texgs.edit.text import edit_by_text
from texgs.fields.surfels.model import Surfels
from texgs.models.filters import ProceduralFilters
from texgs.models.guidance import Guidance
from texgs.models.instruct_pix2pix import NO_LIGHT, InstructPix2Pix
from texgs.models.weights import locate
from texgs.report.strip import write_strip
from texgs.scene.scene_file import read_scene, write_scene
from texgs.volume.reduced import smaller

SHOWN = 6  # edited views in the picture of them


def work(settings: dict[str, Any], inputs: dict[str, Path], output: Path) -> Outcome:
    """Write scene.yaml, a texture for each part, views.png with what was edited, edit.png and turntable.mp4.

    Args:
        settings: what the stage reads of the configuration.
        inputs: `scene`, and for each model `views.MODEL`, the transforms_train.json of its views.
        output: folder.
    """
    edit, text, title = settings["edit"], settings["edit"]["text"], f"{settings['dataset']}: edit"
    device, scene = torch_device(settings["fit"]["device"]), read_scene(inputs["scene"])
    guidance = guidance_of(text, device)
    rows: dict[str, list[np.ndarray]] = {}

    def one(name: str, model: Surfels, surfels: Tensor | None) -> tuple[Surfels, dict[str, Any]]:
        views = views_of(inputs, name)
        start = time.monotonic()
        result = edit_by_text(
            model,
            [smaller(view.camera, settings["reduce"]).to(device) for view in views],
            guidance,
            text["instruction"],
            text["recipe"],
            light=views[0].light,
            surfels=surfels,
            size=text["size"],
            seed=edit["seed"],
        )
        seconds = time.monotonic() - start
        rows[f"{name} before"] = [image.cpu().numpy() for image in result.views.images[:SHOWN]]
        rows[f"{name} edited"] = [image.cpu().numpy() for image in result.images[:SHOWN]]
        return result.model, {"seconds": seconds, "seen": result.seen}

    after, found = edit_parts(scene, edit["parts"], output, device, one)
    write_scene(output / "scene.yaml", after)
    titles = [f"view {index + 1}" for index in range(len(next(iter(rows.values()))))]
    drawn = [write_strip(output / "views.png", rows, titles)]
    numbers = {
        "edit": edit["name"],
        "kind": "text",
        "method": f"{guidance.name}, {text['recipe']}",
        "instruction": text["instruction"],
        "edit_seconds": sum(each["seconds"] for each in found.values()),
        "parts": found,
    }
    return Outcome(numbers, [*show(scene, after, output, device, title), *drawn])


def guidance_of(text: dict[str, Any], device: torch.device) -> Guidance:
    """What edits the views."""
    if text["guidance"] == "filters":
        return ProceduralFilters()
    return InstructPix2Pix.open(
        locate("instruct-pix2pix"),
        device,
        text_scale=text["text_scale"],
        image_scale=text["image_scale"],
        negative=NO_LIGHT if text["negative"] is None else text["negative"],
        epipolar=text["epipolar"],
    )
