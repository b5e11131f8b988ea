"""Frames as a picture, numbered pictures, an animated GIF or an MP4 film."""

from collections.abc import Iterable, Iterator
from fractions import Fraction
from functools import partial
from itertools import chain, pairwise
from pathlib import Path
from typing import IO

import numpy as np
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from texgs.core.errors import ArgumentError
from texgs.core.io import require_place, write_atomic
from texgs.core.memory import require_memory

KINDS = (".png", ".gif", ".mp4")
MAX_FPS, MAX_GIF_FPS = 240.0, 50.0  # browsers slow down shorter frames of a GIF
MIN_GIF_FPS = 0.01  # a GIF counts hundredths of a second in 16 bits
QUALITY_CRF = 18  # constant rate factor of H.264 that looks like the frames


def write_frames(
    path: str | Path,
    frames: Iterable[np.ndarray],
    fps: float = 25.0,
    crf: int = QUALITY_CRF,
    comment: str = "",
) -> Path:
    """Write frames as they come and return the path; the file appears when it is complete.

    The path ends in .png for one frame, .gif or .mp4 for several; without an ending it is a folder, which
    receives one PNG a frame and must not have pictures of another film. Frames are [H, W, 3] uint8, of one
    size. The constant rate factor of H.264 is 0 to 51: the higher, the smaller and the coarser.
    All files have the comment in their metadata.
    """
    path = Path(path)
    if path.suffix not in ("", *KINDS):
        raise ArgumentError(f"{path}: expected {', '.join(KINDS)} or a folder, got {path.suffix}")
    if not 0 < fps <= MAX_FPS:
        raise ArgumentError(f"fps: expected more than 0 and at most {MAX_FPS:g}, got {fps}")
    if path.suffix == ".gif" and not MIN_GIF_FPS <= fps <= MAX_GIF_FPS:
        raise ArgumentError(
            f"fps: expected {MIN_GIF_FPS:g} to {MAX_GIF_FPS:g} in a GIF, got {fps}; write an MP4 film"
        )
    if path.suffix == "" and (there := min(path.glob(f"{'[0-9]' * 4}.png"), default=None)):
        raise ArgumentError(
            f"{path}: expected a folder without numbered pictures, got {there.name} in it; remove them, or "
            "choose another folder"
        )
    require_place(path if path.suffix else path / "0000.png")
    left = iter(frames)
    first = next(left, None)
    if first is None:
        raise ArgumentError(f"{path}: expected at least one frame, got none")
    if path.suffix == "":
        _write_pictures(path, chain([first], left), comment)
    elif path.suffix == ".png":
        if next(left, None) is not None:
            raise ArgumentError(f"{path}: expected one frame, got several; use .gif, .mp4 or a folder")
        write_atomic(path, partial(save_png, frame=first, comment=comment))
    else:
        write = _write_gif if path.suffix == ".gif" else partial(_write_mp4, crf=crf)
        write_atomic(path, lambda file: write(file, first, left, fps, comment))
    return path


def _write_pictures(folder: Path, frames: Iterable[np.ndarray], comment: str) -> None:
    """Write numbered pictures into a folder: all, or none."""
    written: list[Path] = []
    try:
        for number, frame in enumerate(frames):
            written.append(folder / f"{number:04}.png")
            write_atomic(written[-1], partial(save_png, frame=frame, comment=comment))
    except BaseException:
        for file in written:
            file.unlink(missing_ok=True)
        raise


def save_png(file: IO[bytes], frame: np.ndarray, comment: str) -> None:
    """Write one frame [H, W, 3], uint8, with a comment in its metadata."""
    facts = PngInfo()
    if comment:
        facts.add_text("Comment", comment)
    Image.fromarray(frame).save(file, format="PNG", pnginfo=facts)


def _write_gif(
    file: IO[bytes], first: np.ndarray, left: Iterator[np.ndarray], fps: float, comment: str
) -> None:
    """Write frames whose times are rounded so that errors do not add up."""
    kept, n_bytes = [], 0
    for frame in chain([first], left):
        n_bytes += frame.nbytes
        require_memory(n_bytes, "GIF: a copy of all frames, which Pillow makes,", "write an MP4 film")
        kept.append(Image.fromarray(frame))
    ends = [round(100 * index / fps) for index in range(len(kept) + 1)]  # in hundredths of a second
    durations = [10 * (end - start) for start, end in pairwise(ends)]
    facts = {"duration": durations, "loop": 0, "comment": comment.encode()}
    kept[0].save(file, format="GIF", save_all=True, append_images=kept[1:], **facts)


def _write_mp4(
    file: IO[bytes], first: np.ndarray, left: Iterator[np.ndarray], fps: float, comment: str, crf: int
) -> None:
    """Write H.264 with colours at half resolution, which every browser and slide program plays."""
    import av

    height, width = first.shape[:2]
    to_even = ((0, height % 2), (0, width % 2), (0, 0))
    try:
        with av.open(file, "w", format="mp4") as container:
            container.metadata["comment"] = comment
            stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1000))
            stream.height, stream.width = height + height % 2, width + width % 2
            stream.pix_fmt, stream.options = "yuv420p", {"crf": str(crf)}
            for frame in chain([first], left):
                even = np.pad(frame, to_even, mode="edge")
                container.mux(stream.encode(av.VideoFrame.from_ndarray(even, format="rgb24")))
            container.mux(stream.encode())
    except av.error.FFmpegError as error:
        raise ArgumentError(
            f"MP4: {width} x {height} pixels cannot be encoded ({error.strerror}); write a folder of pictures"
        ) from error
