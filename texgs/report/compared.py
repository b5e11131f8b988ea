"""A scene compared with its volume over some views, and the edits that the paper's figures compare."""

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from texgs.core.camera import Camera, orbit
from texgs.core.errors import ArgumentError
from texgs.core.figures import write_grid
from texgs.core.lens import Lens
from texgs.fields.field import Composed
from texgs.fields.files import kind_of
from texgs.metrics.quality import MAX_PSNR, compare, mean
from texgs.raster import Render
from texgs.report.beside_volume import change_words, changes_of, pictures, score_words, side_by_side
from texgs.report.results import COMPARED_VIEWS, ViewComparison
from texgs.scene.cut_view import scene_and_fitted, scene_and_volume
from texgs.scene.frame import frame
from texgs.scene.scene import Scene
from texgs.scene.session import Session
from texgs.scene.twin import Twin

MAX_GAIN = 16.0
POLAR = 20.0  # polar angle of compared views, degrees
LEFT_LIGHT = (-150.0, 20.0)  # azimuth and polar angle of a light, degrees
# Polar angles of the light in the paper's figure, degrees.
SWEEP_ANGLES = (-30.0, -15.0, 0.0, 15.0, 30.0, 45.0)
SHADOWED_SIDE = -60.0  # azimuth of a view that shows shadows, degrees: it sees two sides
# Azimuths and polar angles of lights on the left, on the right, above and behind in that view, degrees.
SHADOWING_LIGHTS = ((-130.0, 30.0), (10.0, 30.0), (-60.0, 75.0), (70.0, 40.0))
SHADOWS, OCCLUSION = 0.8, 0.6  # shares: shadows are plain, and what lies in them can be seen


def mean_scores(pairs: Iterable[tuple[Render, Render]]) -> dict[str, float]:
    """Return the means of `texgs.metrics.quality.compare` over pairs of pictures."""
    measured = defaultdict[str, list[float]](list)
    for image, truth in pairs:
        for name, value in compare(image, truth).items():
            measured[name].append(value)
    return mean(measured)


def compare_views(
    title: str, scene: Scene, composition: Composed, twin: Twin | None, cameras: Sequence[Camera]
) -> tuple[ViewComparison, dict[str, np.ndarray]]:
    """Return PSNR and SSIM against the volume over some views, and all pictures [H, W, 3] of the first."""
    if twin is None:
        return ViewComparison(title), {"scene": frame(composition, cameras[0], scene)}
    shown: dict[str, np.ndarray] = {}

    def pairs() -> Iterator[tuple[Render, Render]]:
        for camera in cameras:
            pair = scene_and_volume(composition, camera, scene, twin)
            shown.update({} if shown else pictures(*pair))
            yield pair

    return ViewComparison(title, **mean_scores(pairs())), shown


class SideBySide:
    """Frames of a scene, its volume or its fit, and their difference; and a summary of all differences.

    Args:
        session: of the scene.
        other: "volume" or "fitted".
        gain: factor on differences, 1 to 16.
    """

    def __init__(self, session: Session, other: str, gain: float) -> None:
        if not 1 <= gain <= MAX_GAIN:
            raise ArgumentError(f"gain: expected 1 to {MAX_GAIN:g}, got {gain:g}")
        if session.scene.shows_volume and other == "volume":
            raise ArgumentError(
                "compare: expected a scene of models, got a cut one that shows its volume; take cuts back by "
                "texgs edit, or compare it with what was fitted"
            )
        if other == "volume":
            session.twin_of(session.scene)  # reports errors of its volume now
        self._session, self._gain, self._is_fitted = session, gain, other == "fitted"
        self._scores, self._changes = defaultdict[str, list[float]](list), list[dict[str, float]]()

    def frames(self, shots: Iterable[tuple[Camera, Scene]]) -> Iterator[np.ndarray]:
        """Yield a picture [H, W, 3], uint8, of each shot."""
        titles = ("scene", "as fitted" if self._is_fitted else "volume")
        for camera, scene in shots:
            image, truth = self._pair(camera, scene)
            picture, scores = side_by_side(image, truth, self._gain, titles)
            for name, value in scores.items():
                self._scores[name].append(value)
            self._changes.append(changes_of(image, truth))
            yield picture

    @property
    def sentences(self) -> list[str]:
        """Return the means of PSNR and SSIM so far, and the changes by edits."""
        scores = ", ".join(score_words(mean(self._scores)))
        if not self._is_fitted:
            return [scores]
        light = self._session.scene.light
        left_out = ["both without shadows and occlusion"] * (light != light.unhidden)
        return [scores, change_words(self._changes), *left_out]

    def _pair(self, camera: Camera, scene: Scene) -> tuple[Render, Render]:
        """Render a view of a scene, and its counterpart."""
        if not self._is_fitted:
            return self._session.beside(camera, scene)
        can = kind_of(next(iter(scene.models.values())).file).can
        outputs = ("depth", "normal") if "normals" in can else ("depth",)
        now, before = (self._session.composition_of(each) for each in (scene, scene.as_fitted))
        return scene_and_fitted(now, before, camera, scene, outputs)


def caption(entry: ViewComparison) -> str:
    """Return the title of a picture, with the mean PSNR of all views, if measured."""
    measured = "" if entry.psnr is None else f"\nmean of {COMPARED_VIEWS} views: {entry.psnr:.1f} dB"
    return entry.title + measured


def chain(scene: Scene, fitted: Sequence[tuple[float, ...]], can: Collection[str]) -> dict[str, Scene]:
    """Return the scenes of the paper's figure by title: opacity, colour, strength and direction of the light.

    Each is on top of those before it. What fields of a kind cannot do is left out, but for the direction of
    the light: without shading it changes nothing.
    """
    names, steps = list(scene.models), {"as fitted": scene}
    changes: list[tuple[str, Mapping[str, Mapping[str, Any]]]] = [
        (f"+ opacity of {names[0]} x 0.4", {names[0]: {"opacity": 0.4}})
    ]
    if "palette" in can:
        turned = {name: {"palette": (b, r, g)} for name, (r, g, b) in zip(names, fitted, strict=True)}
        changes.append(("+ other colours", turned))
    if "relight" in can:
        magnitude = {"ambient": 0.7, "diffuse": 1.2, "specular": 2.0}
        changes.append(("+ k_a x 0.7, k_d x 1.2, k_s x 2", dict.fromkeys(names, magnitude)))
    for title, change in changes:
        scene = steps[title] = with_edits(scene, change)
    return {**steps, "+ light from the left": replace(scene, light=scene.light.turned(*LEFT_LIGHT))}


def light_sweep(scene: Scene) -> dict[str, Scene]:
    """Return the scene under a light that moves from below the object to above it, by title."""
    return {
        f"light at (-90°, {polar:g}°)": replace(scene, light=scene.light.turned(-90.0, polar))
        for polar in SWEEP_ANGLES
    }


def write_light_figure(path: Path, scene: Scene, composition: Composed, twin: Twin, lens: Lens) -> Path:
    """Write a PNG of a scene, and of its volume below, under four lights with shadows and occlusion.

    Above each is the PSNR on the object, and that of the same pictures without both.
    """
    camera = orbit(SHADOWED_SIDE, POLAR, *lens)
    rows, titles = {"scene": list[np.ndarray](), "volume": list[np.ndarray]()}, []
    for azimuth, polar in SHADOWING_LIGHTS:
        light = replace(scene.light.turned(azimuth, polar), shadows=SHADOWS, occlusion=OCCLUSION)
        scenes = (replace(scene, light=each) for each in (light, light.unhidden))
        pair, plain = (scene_and_volume(composition, camera, each, twin) for each in scenes)
        shown = pictures(*pair)
        for name, row in rows.items():
            row.append(shown[name])
        hidden, lit = (compare(*each).get("object_psnr", MAX_PSNR) for each in (pair, plain))
        titles.append(f"({azimuth:g}°, {polar:g}°): {hidden:.1f} dB\nwithout shadows: {lit:.1f} dB")
    return write_grid(path, rows, titles)


def with_edits(scene: Scene, changes: Mapping[str, Mapping[str, Any]]) -> Scene:
    """Return the scene with changed edits of some models."""
    session = Session(scene)
    for part, values in changes.items():
        for key, value in values.items():
            session.set(part, key, value)
    return session.scene
