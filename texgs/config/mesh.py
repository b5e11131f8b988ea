"""The schema of the meshes of fits."""

from dataclasses import dataclass

from texgs.core.keys import key


@dataclass(frozen=True)
class MeshKeys:
    """Surfaces of fits beside those of their volumes."""

    tfs: list[str] = key([], "basic TFs that get one: those with an opaque surface")
    voxel: float = key(1 / 128, "edge of the cells that depth is fused in", "world units", above=0)
    opacity: float = key(0.5, "of a TF, per opacity unit, that makes a surface", above=0, below=1)
    tolerance: float = key(0.01, "distance that counts as right in the F-score", "world units", above=0)
