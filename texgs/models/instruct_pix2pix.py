"""InstructPix2Pix (Brooks et al. 2023): edit views by a diffusion model, in a short loop of our own."""

from itertools import pairwise
from pathlib import Path
from typing import Any, Self

import torch
from torch import Tensor
from torch.nn.functional import interpolate, pad

from texgs.core.errors import ArgumentError, MissingDataError, first_line
from texgs.core.progress import progress
from texgs.models.epipolar import Consistency
from texgs.models.guidance import EditViews
from texgs.models.instruction import require_instruction

PARTS = ("unet", "vae", "text_encoder", "tokenizer", "scheduler")  # folders of the file format
MAX_SIDE = 512  # pixels: the training size of the model
MULTIPLE = 64  # pixels: 8 of a latent times 8 of the UNet's innermost level
NO_LIGHT = (  # negative prompt: the scene has its own light
    "strong light, bright light, dazzling light, shade, darkness, silhouette, obscurity, shadow"
)


class InstructPix2Pix:
    """Edits views as the instruction says, with three-way classifier-free guidance.

    Args:
        modules: by name of `PARTS` but the last: `unet` (UNet2DConditionModel), `vae` (AutoencoderKL),
            `text_encoder` (CLIPTextModel) and `tokenizer`, on one device.
        alphas: [1000 or so] cumulative products of the noise schedule.
        text_scale: s_T, how strongly edits follow the instruction; the paper's value.
        image_scale: s_I, how closely they keep to the condition; the paper's value.
        steps: of denoising (DDIM, eta 0).
        level: timestep of the noise that denoising starts from, below the length of the schedule, where views
            do not say; the image now is noised and not pure noise taken, so that large shapes carry over.
        negative: what edits should not show, in words.
        epipolar: whether views are edited together, with attention across views along epipolar lines, which
            makes them agree more (DGE, Chen et al. 2024); otherwise one by one.
    """

    name = "InstructPix2Pix"
    lit = True

    def __init__(
        self,
        modules: dict[str, Any],
        alphas: Tensor,
        *,
        text_scale: float = 12.5,
        image_scale: float = 1.25,
        steps: int = 20,
        level: int = 998,
        negative: str = NO_LIGHT,
        epipolar: bool = False,
    ) -> None:
        if not 1 <= steps <= level < len(alphas):
            raise ArgumentError(
                f"steps, level: expected 1 <= steps <= level < {len(alphas)}, got {steps} and {level}"
            )
        self.unet, self.vae = modules["unet"], modules["vae"]
        self.text_encoder, self.tokenizer = modules["text_encoder"], modules["tokenizer"]
        self.alphas = alphas.double().cpu()
        self.text_scale, self.image_scale, self.negative = text_scale, image_scale, negative
        self.steps, self.level = steps, level
        self.consistency = Consistency(self.unet) if epipolar else None

    @classmethod
    def open(cls, folder: str | Path, device: torch.device | str = "cpu", **options: Any) -> Self:
        """Read the model from a folder in its published format, with a folder for each of its parts.

        Half precision on a GPU, single on a CPU. Nothing is downloaded, nothing in the files is executed. The
        options are those of the constructor.
        """
        folder = Path(folder)
        if missing := [part for part in PARTS if not (folder / part).is_dir()]:
            raise MissingDataError(
                f"{folder}: expected InstructPix2Pix with folders {', '.join(PARTS)}, got none named "
                f"{', '.join(missing)}; copy timbrooks/instruct-pix2pix there, or choose the guidance filters"
            )
        try:
            modules, scheduler = _read(folder, torch.device(device))
        except ImportError as error:
            raise MissingDataError(
                f"InstructPix2Pix: expected packages diffusers and transformers, got {first_line(error)}; "
                "install them, or choose the guidance filters"
            ) from error
        except (OSError, ValueError, KeyError, RuntimeError, TypeError) as error:
            raise ArgumentError(
                f"{folder}: expected the files of InstructPix2Pix, got {first_line(error)}; copy them again"
            ) from error
        channels = modules["unet"].config.in_channels, modules["unet"].config.out_channels
        if channels != (8, 4) or scheduler.config.prediction_type != "epsilon":
            raise ArgumentError(
                f"{folder}: expected a UNet of 8 and 4 channels that predicts noise, got {channels[0]} and "
                f"{channels[1]} that predicts {scheduler.config.prediction_type}; it is another model"
            )
        return cls(modules, scheduler.alphas_cumprod, **options)

    @torch.no_grad()
    def __call__(self, views: EditViews, instruction: str, generator: torch.Generator) -> Tensor:
        """Edit the views; see `Guidance`. Any size: views are scaled to 512 pixels and back."""
        texts = self.embed(require_instruction(instruction))
        images, conditions = (fit(x.permute(0, 3, 1, 2)) for x in (views.images, views.conditions))
        clean = torch.cat([self.encode(image[None], generator) for image in images])
        kept = torch.cat([self.encode(image[None], None) for image in conditions])
        if self.consistency is not None:
            self.consistency.aim(views.cameras, images.shape[2:])
        latents = self.denoise(clean, kept, texts, self.times(views.level), generator)
        edited = torch.cat([self.decode(latent[None]) for latent in latents])
        return unfit(edited, views.images.shape[1:3]).permute(0, 2, 3, 1).to(views.images)

    def embed(self, instruction: str) -> Tensor:
        """Return the embeddings [3, L, E] of the branches: the instruction, and twice the negative prompt."""
        tokens = self.tokenizer(
            [instruction, self.negative],
            padding="max_length",
            max_length=self.tokenizer.model_max_length,
            truncation=True,
            return_tensors="pt",
        ).input_ids
        wanted, unwanted = self.text_encoder(tokens.to(self.text_encoder.device))[0]
        return torch.stack([wanted, unwanted, unwanted])

    def encode(self, images: Tensor, generator: torch.Generator | None) -> Tensor:
        """Return latents [V, 4, h, w] of images [V, 3, 8h, 8w] in [0, 1].

        With a generator they are sampled and scaled, for denoising; otherwise the mode, for conditions.
        """
        latents = self.vae.encode((2 * images - 1).to(self.vae.device, self.vae.dtype)).latent_dist
        if generator is None:
            return latents.mode()
        noise = torch.randn(latents.mean.shape, generator=generator).to(latents.mean)
        return (latents.mean + latents.std * noise) * self.vae.config.scaling_factor

    def decode(self, latents: Tensor) -> Tensor:
        """Decode latents [V, 4, h, w] to images [V, 3, 8h, 8w] in [0, 1]."""
        scaled = (latents / self.vae.config.scaling_factor).to(self.vae.dtype)
        return (self.vae.decode(scaled).sample.float() / 2 + 0.5).clamp(0, 1)

    def times(self, level: float | None) -> list[int]:
        """Return the timesteps of denoising, from a share of the noise schedule down to 0."""
        longest = len(self.alphas) - 1
        first = self.level if level is None else min(max(round(level * longest), self.steps), longest)
        return torch.linspace(first, 0, self.steps + 1).round().long().tolist()

    def denoise(
        self, clean: Tensor, kept: Tensor, texts: Tensor, times: list[int], generator: torch.Generator
    ) -> Tensor:
        """Noise latents [V, 4, h, w] to the first timestep and denoise them step by step (DDIM)."""
        if clean.dtype == torch.float16:
            clean = clean.float()  # only the networks use half precision
        first = float(self.alphas[times[0]])
        noise = torch.randn(clean.shape, generator=generator).to(clean)
        latents = first**0.5 * clean + (1 - first) ** 0.5 * noise
        for time, after in progress(pairwise(times), len(times) - 1, title=self.name, unit="step"):
            predicted = self.predict(latents, kept, texts, time, generator)
            now, then = float(self.alphas[time]), float(self.alphas[after])
            start = (latents - (1 - now) ** 0.5 * predicted) / now**0.5
            latents = then**0.5 * start + (1 - then) ** 0.5 * predicted
        return latents

    def predict(
        self, latents: Tensor, kept: Tensor, texts: Tensor, time: int, generator: torch.Generator
    ) -> Tensor:
        """Return the guided noise [V, 4, h, w] of all views.

        e(0, 0) + s_I [e(c_I, 0) - e(0, 0)] + s_T [e(c_I, c_T) - e(c_I, 0)] (Brooks et al. 2023, eq. 3)
        """

        def branches(ids: list[int]) -> Tensor:
            """Return the noise [3, K, 4, h, w] of some views: text and image, image alone, neither."""
            condition = torch.stack([kept[ids], kept[ids], torch.zeros_like(kept[ids])]).to(latents)
            stacked = torch.cat([latents[ids].expand(3, -1, -1, -1, -1), condition], dim=2)
            words = texts[:, None].expand(-1, len(ids), -1, -1)
            inputs, dtype = stacked.flatten(0, 1).to(self.unet.dtype), self.unet.dtype
            noise = self.unet(inputs, time, words.flatten(0, 1).to(dtype)).sample
            return noise.to(latents).unflatten(0, (3, len(ids)))

        if self.consistency is not None:
            noise = self.consistency.run(branches, len(latents), time, generator)
        else:
            noise = torch.cat([branches([index]) for index in range(len(latents))], dim=1)
        both, image, neither = noise
        return neither + self.image_scale * (image - neither) + self.text_scale * (both - image)


def _read(folder: Path, device: torch.device) -> tuple[dict[str, Any], Any]:
    """Return the modules on the device and the scheduler, for its noise levels."""
    from diffusers import AutoencoderKL, DDIMScheduler, UNet2DConditionModel
    from transformers import CLIPTextModel, CLIPTokenizer

    dtype = torch.float16 if device.type == "cuda" else torch.float32
    local: dict[str, Any] = {"local_files_only": True}
    weights = {**local, "torch_dtype": dtype, "use_safetensors": True}
    modules = {
        "unet": UNet2DConditionModel.from_pretrained(folder / "unet", **weights),
        "vae": AutoencoderKL.from_pretrained(folder / "vae", **weights),
        "text_encoder": CLIPTextModel.from_pretrained(
            folder / "text_encoder", **local, dtype=dtype, use_safetensors=True
        ),
    }
    modules = {name: module.to(device).eval().requires_grad_(False) for name, module in modules.items()}
    modules["tokenizer"] = CLIPTokenizer.from_pretrained(folder / "tokenizer", **local)
    return modules, DDIMScheduler.from_pretrained(folder / "scheduler", **local)


def fitting_size(height: int, width: int) -> tuple[int, int]:
    """Return height and width of an image scaled so that the longer side is `MAX_SIDE`."""
    scale = MAX_SIDE / max(height, width)
    return max(1, round(height * scale)), max(1, round(width * scale))


def fit(images: Tensor) -> Tensor:
    """Return images [V, 3, H, W] scaled to `MAX_SIDE` and padded at right and bottom with their edges."""
    height, width = fitting_size(*images.shape[2:])
    scaled = images
    if (height, width) != tuple(images.shape[2:]):
        scaled = interpolate(images, (height, width), mode="bicubic", antialias=True).clamp(0, 1)
    return pad(scaled, (0, -width % MULTIPLE, 0, -height % MULTIPLE), mode="replicate")


def unfit(images: Tensor, size: tuple[int, int] | torch.Size) -> Tensor:
    """Invert `fit`: return images at height and width `size`."""
    height, width = fitting_size(*size)
    cut = images[..., :height, :width]
    if (height, width) == tuple(size):
        return cut
    return interpolate(cut.float(), tuple(size), mode="bicubic", antialias=True).clamp(0, 1)
