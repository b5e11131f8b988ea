"""The catalogue of pretrained weights: files, sizes, sources and checksums."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from texgs.core.errors import ArgumentError
from texgs.core.names import close


@dataclass(frozen=True)
class File:
    """A file of weights."""

    name: str
    megabytes: float
    sha256: str


@dataclass(frozen=True)
class Single:
    """A model whose weights are one file."""

    file: File  # to download
    source: str  # its address
    same: tuple[File, ...] = ()  # equivalent files, searched first

    @property
    def files(self) -> tuple[File, ...]:
        """Return all files to search for, in order."""
        return (*self.same, self.file)

    @property
    def megabytes(self) -> float:
        """Return the size of the download."""
        return self.file.megabytes


@dataclass(frozen=True)
class Snapshot:
    """A model that is a folder of the Hugging Face hub, at one revision."""

    repository: str
    revision: str
    megabytes: float
    needs: tuple[tuple[str, ...], ...]  # required files, each with alternative names
    patterns: tuple[str, ...]  # of the files to download
    packages: tuple[str, ...] = ("transformers",)  # its readers, of the extra `models`

    @property
    def source(self) -> str:
        """Return the page of the model."""
        return f"https://huggingface.co/{self.repository}"


@dataclass(frozen=True)
class Pipeline(Snapshot):
    """A pipeline of diffusers that edits images."""

    megabytes: float = 0  # 0: unknown
    needs: tuple[tuple[str, ...], ...] = ()  # from its index, see `pipeline_files`
    patterns: tuple[str, ...] = ("*.json", "*.txt", "*.jinja", "*/*.safetensors")
    packages: tuple[str, ...] = ("transformers", "diffusers")
    numbers: Mapping[str, Any] = field(default_factory=dict)  # from its model card, such as scales


# Backbones of CLIP to choose from, for scores and for losses; the first one is the default.
CLIP_BACKBONES = ("clip-vit-base-patch32", "clip-vit-large-patch14")
CLIP_FILES = (("config.json",), ("model.safetensors", "pytorch_model.bin"), ("tokenizer.json", "vocab.json"))
TEXT_FILES = ("*.json", "*.txt")
DIFFUSION_FILES = (
    "unet/diffusion_pytorch_model.safetensors",
    "vae/diffusion_pytorch_model.safetensors",
    "text_encoder/model.safetensors",
)

VGG16_HALF = File(  # the convolutions alone
    "vgg16_features_fp16.safetensors",
    29.4,
    "4226839ba20eb3835e9fa6fe2d50a2e2c3b0db26fc00a3fc21b2c892c1703b9e",
)

CATALOGUE: dict[str, Single | Snapshot] = {
    "vgg16": Single(
        File("vgg16-397923af.pth", 553.4, "397923af8e79cdbb6a7127f12361acd7a2f83e06b05044ddf496e83de57a5bf0"),
        "https://download.pytorch.org/models/vgg16-397923af.pth",
        (VGG16_HALF,),
    ),
    "lpips_vgg": Single(
        File(
            "lpips_lin_v0.1_vgg.pth",
            0.007,
            "a78928a0af1e5f0fcb1f3b9e8f8c3a2a5a3de244d830ad5c1feddc79b8432868",
        ),
        "https://raw.githubusercontent.com/richzhang/PerceptualSimilarity/"
        "082bb24f84c091ea94de2867d34c4544f68e0963/lpips/weights/v0.1/vgg.pth",
    ),
    "mobile_sam": Single(
        File("mobile_sam.pt", 40.7, "6dbb90523a35330fedd7f1d3dfc66f995213d81b29a5ca8108dbcdd4e37d6c2f"),
        "https://raw.githubusercontent.com/ChaoningZhang/MobileSAM/master/weights/mobile_sam.pt",
    ),
    "sam_vit_h": Single(
        File(
            "sam_vit_h_4b8939.pth", 2564.6, "a7bf3b02f3ebf1267aba913ff637d9a2d5c33d3173bb679e46d9f338c26f262e"
        ),
        "https://dl.fbaipublicfiles.com/segment_anything/sam_vit_h_4b8939.pth",
    ),
    "clip-vit-base-patch32": Snapshot(
        "openai/clip-vit-base-patch32",
        "3d74acf9a28c67741b2f4f2ea7635f0aaf6f0268",
        605,
        CLIP_FILES,
        (*TEXT_FILES, "pytorch_model.bin"),
    ),
    "clip-vit-large-patch14": Snapshot(
        "openai/clip-vit-large-patch14",
        "32bd64288804d66eefd0ccbe215aa642df71cc41",
        1710,
        CLIP_FILES,
        (*TEXT_FILES, "model.safetensors"),
    ),
    "instruct-pix2pix": Snapshot(
        "timbrooks/instruct-pix2pix",
        "31519b5cb02a7fd89b906d88731cd4d6a7bbf88d",
        4270,
        (
            ("model_index.json",),
            *((f"{part}/config.json",) for part in ("unet", "vae", "text_encoder")),
            ("scheduler/scheduler_config.json",),
            ("tokenizer/tokenizer.json", "tokenizer/vocab.json"),
            *((file,) for file in DIFFUSION_FILES),
        ),
        (*TEXT_FILES, *DIFFUSION_FILES),
        ("transformers", "diffusers"),
    ),
    "sdxl-instruct-pix2pix": Pipeline(
        *("diffusers/sdxl-instructpix2pix-768", "06653d47f8d22f2c2205a5884d6a24c5e76d2ca7", 12600),
        numbers={"size": 768, "steps": 30, "text_scale": 3.0, "image_scale": 1.5},
    ),
    "flux2-klein": Pipeline(
        *("black-forest-labs/FLUX.2-klein-4B", "e7b7dc27f91deacad38e78976d1f2b499d76a294", 15970),
        numbers={"size": 1024, "steps": 4, "text_scale": 1.0},
    ),
    "qwen-image-edit": Pipeline(
        *("Qwen/Qwen-Image-Edit", "ac7f9318f633fc4b5778c59367c8128225f1e3de", 57700),
        numbers={"size": 1024, "steps": 50, "text_scale": 4.0},
    ),
}
PIPELINES = {name: entry for name, entry in CATALOGUE.items() if isinstance(entry, Pipeline)}
HUB = "OWNER/NAME@REVISION (40 digits)"
PINNED_PATTERN = re.compile(r"([\w.-]+/[\w.-]+)@([0-9a-f]{40})")


def entry_of(name: str) -> Single | Snapshot:
    """Return a model by its name, or a pipeline of the Hugging Face hub by OWNER/NAME@REVISION."""
    if pinned := PINNED_PATTERN.fullmatch(name):
        return Pipeline(pinned[1], pinned[2])
    if name not in CATALOGUE:
        expected = f"one of {', '.join(CATALOGUE)} or {HUB}"
        raise ArgumentError(f"weights: expected {expected}, got {name!r}{close(name, CATALOGUE)}")
    return CATALOGUE[name]
