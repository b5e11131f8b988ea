"""How much a styled series flickers beside the same series without a style, and beside its volumes.

`python -m benchmarks.flicker OUTPUT.json FOLDER` reads the steps that `python -m benchmarks.series` has left
in the folder, lays a picture onto the first step of each series, and shows all steps with these texels from
one camera: `once`. `anew` is the same picture laid onto each step by itself. Frames are moved onto the next
ones by the optical flow of the volume's frames (DIS), and compared where both show the object: root mean
square of colours, `warped`; `plain` is without the move. Films of all are written beside the steps.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import torch
from scipy.ndimage import gaussian_filter

from benchmarks import machine
from benchmarks.command import call
from benchmarks.series import LOOK, SAMPLES, SIZE, STEPS, TFS, lens_of
from texgs.core.camera import orbit
from texgs.core.light import HEADLIGHT
from texgs.core.movie import write_frames
from texgs.edit.style_start import laid_out, pixel_side
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import read_model
from texgs.fields.surfels.step_file import at_step
from texgs.fields.surfels.texels import recolored
from texgs.volume.caster import Caster
from texgs.volume.generate_series import SERIES
from texgs.volume.generate_series import series as made

BLOTS = 6.0  # pixels of the picture: standard deviation of what is blurred to blots of four colours
COLORS = np.array([[0.1, 0.2, 0.5], [0.9, 0.75, 0.2], [0.85, 0.3, 0.15], [0.95, 0.95, 0.9]], np.float32)


def main(output: str, folder: str) -> None:
    """Measure series, and write what was measured."""
    measured = {name: flicker(name, Path(folder) / name) for name in SERIES}
    facts = {"machine": machine.describe(torch.device("cpu")), "series": measured}
    Path(output).write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")


@torch.no_grad()
def flicker(name: str, folder: Path) -> dict:
    """Render all steps of a series in all ways, and return how much each differs from one to the next."""
    grids, tf = made(name, SAMPLES, STEPS), TFS[name]
    camera = orbit(30, 20, *lens_of(grids[STEPS // 2], tf))
    key = read_model(folder / "finer-0.safetensors")
    picture, pixel = blots(), pixel_side(key, [camera])
    styled = recolored(key, laid_out(key.parameters, picture, pixel)).parameters
    look = {part: styled[part] for part in ("texels", "colors")}
    films: dict[str, list[np.ndarray]] = {kind: [] for kind in ("volume", "unstyled", "once", "anew")}
    for step, grid in enumerate(grids):
        model = at_step(key, folder / f"step-{step}.safetensors") if step else key
        seen = Caster(grid, LOOK).cast(tf, camera, HEADLIGHT).rgba
        films["volume"].append((seen[..., :3] + 1 - seen[..., 3:]).numpy())
        once = replace(model, parameters={**model.parameters, **look})
        anew = recolored(model, laid_out(model.parameters, picture, pixel))
        for kind, each in (("unstyled", model), ("once", once), ("anew", anew)):
            films[kind].append(shown(each, camera))
    for kind, frames in films.items():
        write_frames(folder / f"{kind}.mp4", [np.uint8(255 * frame.clip(0, 1)) for frame in frames], 8.0)
    flows = [flow(*pair) for pair in pairwise(films["volume"])]
    return {kind: differences(frames, films["volume"], flows) for kind, frames in films.items()}


def blots() -> torch.Tensor:
    """Return a picture [3, 256, 256] of blots in four colours."""
    noise = gaussian_filter(np.random.default_rng(0).standard_normal((256, 256)), BLOTS, mode="wrap")
    levels = np.searchsorted(np.quantile(noise, [0.25, 0.5, 0.75]), noise)
    return torch.from_numpy(COLORS[levels]).permute(2, 0, 1).contiguous()


def shown(model: Surfels, camera) -> np.ndarray:
    """Return a frame [H, W, 3]."""
    return model.render(camera).color.numpy()


def flow(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return where each pixel [H, W, 2] of a frame is in the next one."""
    grey = [cv2.cvtColor(np.uint8(255 * frame.clip(0, 1)), cv2.COLOR_RGB2GRAY) for frame in (before, after)]
    y, x = np.mgrid[:SIZE, :SIZE].astype(np.float32)
    moves = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM).calc(*grey, None)
    return moves + np.stack([x, y], axis=2)


def differences(
    frames: Sequence[np.ndarray], truth: Sequence[np.ndarray], flows: Sequence[np.ndarray]
) -> dict[str, float]:
    """Return the root mean square difference of neighbouring frames on the object, moved and not."""
    totals: dict[str, list[float]] = {"warped": [], "plain": []}
    for index, (before, after) in enumerate(pairwise(frames)):
        there = [frame.min(axis=2) < 0.98 for frame in truth[index : index + 2]]
        moved = cv2.remap(after, flows[index], None, cv2.INTER_LINEAR)
        landed = cv2.remap(np.uint8(there[1]), flows[index], None, cv2.INTER_NEAREST) > 0
        for kind, other, seen in (("warped", moved, landed), ("plain", after, there[1])):
            totals[kind].append(float(np.square(other - before)[there[0] & seen].mean()))
    return {kind: float(np.sqrt(np.mean(squares))) for kind, squares in totals.items()}


if __name__ == "__main__":
    call(main, "benchmarks.flicker texgs.fitting.series")
