"""Films of a scene: shots in which the camera, a light, a cut or time moves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.scene.shot import Shot

if TYPE_CHECKING:
    import numpy as np
    import torch

    from texgs.core.camera import Camera
    from texgs.core.lens import Lens
    from texgs.fields.field import Composed
    from texgs.scene.scene import Scene

Movement = Literal["view", "test", "orbit", "light", "cut", "time", "orbit-time"]
# Frames by default.
COUNTS = {"view": 1, "test": 181, "orbit": 72, "light": 61, "cut": 61, "time": 61, "orbit-time": 72}
MAX_FRAMES = 100_000  # an hour of film
MARGIN = 0.1  # distance from the visible data at which a moving plane starts and ends, relative to its extent


@dataclass(frozen=True)
class Film(Shot):
    """A shot with a movement."""

    what: Movement = key(
        "view",
        "what moves: nothing in view; the camera on the path of test views or on an orbit; the light, as the "
        "paper shows relighting; the last plane that cuts, through it all; time, through the steps of the "
        "series; or both, camera and time",
        option="path",
    )
    frames: int | None = key(
        None, "how many; default test 181, orbit and orbit-time 72, else 61", least=1, most=MAX_FRAMES
    )
    seconds: float | None = key(None, "length of a film, in place of a number of frames", above=0)
    fps: float = key(25.0, "frames per second", above=0)
    keys: Any = key(None, "file of keyframes, or a list in Python, in place of a movement", option="film")

    def __post_init__(self) -> None:
        if self.keys is not None:
            from texgs.scene.keyframes import read_keys

            object.__setattr__(self, "keys", read_keys(self.keys, self, self.fps))
            if self.what not in ("view", "orbit"):  # defaults here and in Python
                raise ArgumentError(f"film: expected keys or a path, got keys and {self.what}; leave one out")
        if sum(each is not None for each in (self.frames, self.seconds, self.keys)) > 1:
            raise ArgumentError("frames: expected a number of frames or of seconds, or keys, got several")
        if self.count > MAX_FRAMES:
            raise ArgumentError(f"seconds: expected at most {MAX_FRAMES} frames, got {self.count}")

    @property
    def count(self) -> int:
        """Return the number of frames."""
        if self.keys is not None:
            return self.keys[-1].at + 1
        if self.seconds is not None:
            return max(1, round(self.seconds * self.fps))
        return COUNTS[self.what] if self.frames is None else self.frames

    def shots(
        self, scene: Scene, composition: Composed | None = None, lens: Lens | None = None
    ) -> Iterator[tuple[Camera, Scene]]:
        """Return camera and scene of each frame.

        Args:
            scene: to show.
            composition: its models, where they are open.
            lens: of the camera; default what the film says of it.

        Raises:
            ArgumentError: if a cut or time is to move, and the scene has none.
        """
        from texgs.core.camera import orbit
        from texgs.scene.keyframes import keyed_shots
        from texgs.volume.cameras import orbit_path, spiral

        framed = scene.framed(composition)
        if self.keys is not None:
            keyed = keyed_shots(self.keys, scene, composition or scene.open())
            return ((shot.camera(framed), shown) for shot, shown in keyed)
        lens, count = lens or self.lens(framed), self.count
        if self.what == "test":
            return ((camera, scene) for camera in spiral(count, lens, "frames"))
        azimuth = scene.framed(composition).azimuth if self.azimuth is None else self.azimuth
        turn = orbit_path(count, self.polar, lens, azimuth)
        if self.what == "orbit":
            return ((place, scene) for place in turn)
        camera = orbit(azimuth, self.polar, *lens)
        if self.what == "view":
            return repeat((camera, scene), count)
        shares = (i / max(count - 1, 1) for i in range(count))
        if self.what in ("time", "orbit-time"):
            last = len(scene.timeline.steps) - 1
            places = turn if self.what == "orbit-time" else repeat(camera)
            return ((at, scene.at(round(share * last))) for at, share in zip(places, shares, strict=False))
        if self.what == "cut":
            low, high = sweep_range(scene, composition or scene.open())
            return ((camera, move_planes(scene, high + share * (low - high))) for share in shares)
        # from below the object to above, on the camera's side
        lights = (scene.light.turned(azimuth, -90 + 180 * share) for share in shares)
        return ((camera, replace(scene, light=light)) for light in lights)

    def write(
        self,
        path: str | Path,
        frames: Iterable[np.ndarray],
        comment: str = "",
        title: str = "",
        **options: int,
    ) -> Path:
        """Write frames [H, W, 3 or 4], uint8, as they come, with a progress bar; return the path.

        Args:
            path: of the film, see `write_frames`.
            frames: as many as it has.
            comment: in the metadata of all files.
            title: of the progress; default the name of the film.
            **options: of `write_frames`.
        """
        from texgs.core.movie import write_frames
        from texgs.core.progress import progress

        suffix = Path(path).suffix
        if self.count > 1 and suffix == ".png":
            raise ArgumentError(f"{path}: expected one frame, got {self.count}; use .gif, .mp4 or a folder")
        if self.transparent and suffix not in ("", ".png"):
            raise ArgumentError(f"{path}: expected PNG for transparent pictures, got {suffix}")
        if self.count > 1:
            frames = progress(frames, self.count, title=title or Path(path).name, unit="frame")
        return write_frames(path, frames, self.fps, comment=comment, **options)


def frames_of(
    scene: Scene, shots: Iterable[tuple[Camera, Scene]], device: torch.device | str
) -> Iterator[np.ndarray]:
    """Yield frames [H, W, 3], uint8, of pairs of a camera and a scene."""
    from texgs.scene.session import Session

    session = Session(scene, device)
    return (session.picture(camera, Shot(), shown) for camera, shown in shots)


def sweep_range(scene: Scene, composition: Composed) -> tuple[float, float]:
    """Return the range of offsets for the moving last plane; both ends show something."""
    from texgs.scene.bounds import STRAY_SHARE, models_of, span_of

    if not scene.cuts.planes:
        raise ArgumentError("path cut: expected a scene that a plane cuts, got none; texgs edit cut=x,0")
    models = zip(models_of(composition), scene.models.values(), strict=False)  # all of them have means
    shown = [model for model, entry in models if entry.edit.visible or entry.segments]
    low, high = span_of(shown, scene.framed(composition), scene.cuts.planes[-1].normal, STRAY_SHARE)
    return low + MARGIN * (high - low), high - MARGIN * (high - low)


def move_planes(scene: Scene, offset: float) -> Scene:
    """Return the scene with another offset of its last plane."""
    *others, last = scene.cuts.planes
    return replace(scene, cuts=replace(scene.cuts, planes=[*others, replace(last, offset=offset)]))
