"""Newer editors, each view alone: image-to-image pipelines of diffusers, and servers at an address."""

import inspect
import json
from base64 import b64decode, b64encode
from io import BytesIO
from pathlib import Path
from typing import Any, Self
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import numpy as np
import torch
from PIL import Image
from torch import Tensor
from torch.nn.functional import interpolate

from texgs.core.errors import ArgumentError
from texgs.core.image import to_pillow
from texgs.core.io import reading_as
from texgs.core.progress import progress
from texgs.models.guidance import EditViews
from texgs.models.instruct_pix2pix import NO_LIGHT
from texgs.models.instruction import require_instruction

ARGUMENT_NAMES = {
    "steps": "num_inference_steps",
    "image_scale": "image_guidance_scale",
    "negative": "negative_prompt",
}
MULTIPLE = 16  # pixels: divisor of image sides, for autoencoders and patches of transformers
QUOTED_BYTES = 200  # bytes of an unreadable reply to quote in the error
TIMEOUT = 600.0  # seconds without a reply from a server


class EachAlone:
    """Edits views one by one, all with the same seed; options are some of those of InstructPix2Pix."""

    lit = True

    def __init__(self, name: str, options: dict[str, Any]) -> None:
        self.name, self.options = name, options

    @torch.no_grad()
    def __call__(self, views: EditViews, instruction: str, generator: torch.Generator) -> Tensor:
        """Edit the views; see `Guidance`."""
        asked = {"instruction": require_instruction(instruction), "level": views.level}
        asked["seed"] = int(torch.randint(2**31, (), generator=generator))
        images = progress(views.images, len(views), title=self.name, unit="view")
        return torch.stack([self.edit(image, asked) for image in images])

    def edit(self, image: Tensor, asked: dict[str, Any]) -> Tensor:
        """Return an image [H, W, 3] edited by an instruction, with a seed, from a level of noise or None."""
        raise NotImplementedError


class ImagePipeline(EachAlone):
    """A diffusers pipeline, called with the arguments it accepts; the others keep its defaults.

    The longer side of a view is scaled to `size` pixels, or stays; what comes back is scaled to the view.
    Light and shadow are not wanted, where it takes such words. A level of noise is its strength, if any.
    """

    def __init__(self, pipeline: Any, name: str, size: int | None = None, **options: Any) -> None:
        self.takes = takes = inspect.signature(pipeline.__call__).parameters
        # Some pipelines reserve guidance_scale, default None, for future models; then the other scale counts.
        is_plain = (scale := takes.get("guidance_scale")) and scale.default is not None
        names = {**ARGUMENT_NAMES, "text_scale": "guidance_scale" if is_plain else "true_cfg_scale"}
        for key in options:
            if names[key] not in takes:
                raise ArgumentError(f"{key}: expected none, as {name} takes no {names[key]}; leave {key} out")
        unwanted = {"negative": NO_LIGHT} if "negative_prompt" in takes else {}
        super().__init__(name, {names[key]: value for key, value in (unwanted | options).items()})
        self.pipeline, self.size = pipeline, size

    @classmethod
    def open(cls, folder: Path, name: str, device: torch.device, **options: Any) -> Self:
        """Read a pipeline from its folder; nothing is downloaded, and nothing in the files is executed.

        In single precision on a CPU, in bfloat16 on a GPU: in float16 the large ones overflow.
        """
        how: dict[str, Any] = {"torch_dtype": torch.bfloat16 if device.type == "cuda" else torch.float32}
        how |= {"local_files_only": True, "use_safetensors": True}
        advice = "copy it again, install what it needs (pip install '.[models]'), or choose another"
        with reading_as("a pipeline of diffusers that edits images", advice, f"{folder}: "):
            from diffusers import AutoPipelineForImage2Image, DiffusionPipeline

            pipeline = DiffusionPipeline.from_pretrained(folder, **how)
            if "image" not in inspect.signature(pipeline.__call__).parameters:  # text to image only
                pipeline = AutoPipelineForImage2Image.from_pipe(pipeline)
        pipeline.set_progress_bar_config(disable=True)
        return cls(pipeline.to(device), name, **options)

    def edit(self, image: Tensor, asked: dict[str, Any]) -> Tensor:
        """Return an image [H, W, 3], edited."""
        sides, planes = image.shape[:2], image.permute(2, 0, 1)[None]
        scale = (self.size or max(sides)) / max(sides) / MULTIPLE
        height, width = (MULTIPLE * max(1, round(scale * side)) for side in sides)
        shown = interpolate(planes, (height, width), mode="bicubic", antialias=True)[0].permute(1, 2, 0)
        about = {"height": height, "width": width, "strength": asked["level"]}
        about = {key: value for key, value in about.items() if key in self.takes and value is not None}
        about |= {"prompt": asked["instruction"], "generator": torch.Generator().manual_seed(asked["seed"])}
        with reading_as(f"an edited view of {self.name}", "change the edit, or choose another editor"):
            made = self.pipeline(image=to_pillow(shown), output_type="np", **self.options, **about).images[0]
            planes = torch.as_tensor(made).float().permute(2, 0, 1)[None]
        return interpolate(planes, sides, mode="bicubic", antialias=True)[0].permute(1, 2, 0)


def image_of(request: Request) -> Any:
    """Return the image in a server's reply; otherwise raise an error that quotes the reply."""
    try:
        with urlopen(request, timeout=TIMEOUT) as reply:
            body = reply.read()
    except HTTPError as error:
        words = error.read(QUOTED_BYTES).decode(errors="replace")
        raise ValueError(f"{error}, {words}" if words else str(error)) from error
    found = json.loads(body)
    if not isinstance(found, dict) or "image" not in found:
        raise ValueError(body[:QUOTED_BYTES].decode(errors="replace"))
    return found["image"]


class Endpoint(EachAlone):
    """A server at an address that gets one request per view, see docs/extend.md."""

    def edit(self, image: Tensor, asked: dict[str, Any]) -> Tensor:
        """Return an image [H, W, 3], edited. The request is sent once."""
        shown = to_pillow(image)
        shown.save(file := BytesIO(), "PNG")
        asked = {"image": b64encode(file.getvalue()).decode(), **asked, **self.options}
        body = json.dumps({name: value for name, value in asked.items() if value is not None}).encode()
        advice = "does the server run there, and reply as docs/extend.md says?"
        with reading_as('{"image": a PNG in base64}', advice, f"{self.name}: "):
            request = Request(self.name, body, {"Content-Type": "application/json"})
            content = BytesIO(b64decode(image_of(request), validate=True))
            with Image.open(content, formats=("PNG",)) as edited:
                wanted, got = (f"{x.mode} of {x.width} x {x.height}" for x in (shown, edited))
                if wanted != got:
                    raise ValueError(f"{got} for {wanted}")
                return torch.tensor(np.asarray(edited)).float() / 255
