"""The backbones of CLIP to choose from, for scores and for losses; the first one is the default."""

BACKBONES = ("clip-vit-base-patch32", "clip-vit-large-patch14")
