"""Pictures of an edit: the scene before and after, and the losses."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from texgs.core.figures import new_figure, words, write_figure, write_grid
from texgs.core.lens import SIGHTS, Lens
from texgs.core.progress import progress
from texgs.fields.kinds import Kind
from texgs.scene.film import Film, frames_of
from texgs.scene.scene import Scene
from texgs.volume.cameras import sights

SIDE_LIGHT = (-30.0, 40.0)  # azimuth and polar angle of a light that no edit has seen, degrees
SIZE = 512  # pixels of a picture
TURNTABLE_FRAMES = 36  # frames of the turntable


def write_before_and_after(
    before: Scene, after: Scene, kind: Kind, lens: Lens, output: Path, device: torch.device, title: str
) -> None:
    """Write edit.png, views of both, under another light where they can be relit too, and turntable.mp4."""
    titles, cameras = map(list, zip(*sights(lens.square(SIZE)).items(), strict=True))
    lights = [before.light] * len(cameras)
    if "relight" in kind.can:
        cameras, lights, titles = (
            [*cameras, cameras[0]],
            [*lights, before.light.turned(*SIDE_LIGHT)],
            [*titles, "light from the side"],
        )
    scenes = {"before": before, "after": after}
    rows = {}
    for name, scene in scenes.items():
        seen = [(camera, replace(scene, light=light)) for camera, light in zip(cameras, lights, strict=True)]
        shown = frames_of(scene, seen, device)
        rows[name] = list(progress(shown, len(cameras), title=f"{title}, {name}", unit="picture"))
    write_grid(output / "edit.png", rows, titles)
    azimuth, polar = SIGHTS["front"]
    film = Film(what="orbit", frames=TURNTABLE_FRAMES, azimuth=azimuth, polar=polar)
    turned = lens.square(kind.film_size)
    halves = [frames_of(scene, film.shots(scene, lens=turned), device) for scene in scenes.values()]
    frames = (np.concatenate(pair, axis=1) for pair in zip(*halves, strict=True))
    film.write(output / "turntable.mp4", frames, title=f"{title}, turntable")


def write_convergence(path: str | Path, curves: Mapping[str, Mapping[str, Sequence[float]]]) -> Path:
    """Write a PNG of an edit's weighted losses over its iterations, by part and term."""
    figure = new_figure(8, 3.2, 120)
    axes = figure.subplots()
    axes.set(xlabel="iterations, one view each", ylabel="loss of one view")
    for name, terms in curves.items():
        for term, values in terms.items():
            axes.plot(range(1, len(values) + 1), values, label=words(f"{name}: {term}"), linewidth=1)
    if axes.lines:
        axes.legend(fontsize=7)
    return write_figure(path, figure)
