"""The backbones of CLIP to choose from: scores of one cannot be compared with those of another."""

from typing import Any

from texgs.config.keys import key

BACKBONES = ("clip-vit-base-patch32", "clip-vit-large-patch14")


def backbone(help: str) -> Any:
    """A key whose value is a backbone; `help` says what for."""
    return key(BACKBONES[0], f"backbone of {help}", choices=BACKBONES)
