"""The page for voters: one HTML file with all clips that works offline and names no method.

A clip is a film of several scenes that turn in step, each in its cell of one picture: it cannot fall apart.
"""

import base64
import hashlib
import io
from collections.abc import Sequence
from dataclasses import replace
from importlib.resources import files
from math import ceil, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import torch

from texgs.core.image import open_picture
from texgs.core.lens import FRONT
from texgs.scene.film import Film, frames_of
from texgs.scene.scene import WHITE, Scene
from texgs.study.questions import Question, rank_name

POLAR = 20.0  # degrees above the horizon
CRF = 23  # of H.264; half the bytes of other films, so that the page can be mailed
PICTURE = 320  # pixels, the longest side of a style picture
TASKS = {  # questions for voters, by the kind of edits
    "style": ("The new looks follow this picture.", "The new looks follow these pictures, each in a part."),
    "instruction": ("The new looks follow this instruction:", "Instructions for parts of the scene:"),
}


def cell(index: int, count: int) -> tuple[int, int]:
    """Return column and row of a scene in a nearly square grid of cells."""
    columns = ceil(sqrt(count))
    return index % columns, index // columns


def write_film(
    path: str | Path, scenes: Sequence[Scene], size: int, frames: int, device: torch.device, title: str
) -> Path:
    """Write one turn around scenes as MP4, with common cameras, background and cell size in pixels.

    The cameras show the frame of the first scene.
    """
    film = Film(what="orbit", frames=frames, azimuth=FRONT, polar=POLAR, width=size)
    lens = film.lens(scenes[0].framed())
    plain = [replace(scene, background=WHITE) for scene in scenes]
    turned = [frames_of(scene, film.shots(scene, lens=lens), device) for scene in plain]
    return film.write(path, map(mosaic, zip(*turned, strict=True)), title=title, crf=CRF)


def mosaic(pictures: Sequence[np.ndarray]) -> np.ndarray:
    """Arrange equally large pictures [H, W, 3] in cells; empty cells are white."""
    height, width = pictures[0].shape[:2]
    places = [cell(index, len(pictures)) for index in range(len(pictures))]
    columns, rows = (1 + max(place) for place in zip(*places, strict=True))
    whole = np.full((rows * height, columns * width, 3), 255, dtype=np.uint8)
    for (column, row), picture in zip(places, pictures, strict=True):
        whole[row * height : (row + 1) * height, column * width : (column + 1) * width] = picture
    return whole


def ballot_page(study: str, questions: Sequence[Question], films: Sequence[bytes], size: int) -> str:
    """Return the page as HTML; ballots carry the digest of the study.

    The film of a question is an MP4 with the scene before the edits and the options, in cells of a size.
    """
    from jinja2 import Environment

    style, script = (text_of(f"ballot.{kind}") for kind in ("css", "js"))
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(text_of("ballot.html.j2")).render(
        study=study,
        size=size,
        questions=list(map(entry, range(1, len(questions) + 1), questions, films)),
        style=style,
        script=script,
        hashes={"style": policy_hash(style), "script": policy_hash(script)},
    )


def entry(number: int, question: Question, film: bytes) -> dict[str, Any]:
    """Return a question as values for the template."""
    count = len(question.options)
    words = list(dict.fromkeys(question.followed.values())) if question.follows == "instruction" else []
    places = [dict(zip(("column", "row"), cell(index, count + 1), strict=True)) for index in range(count + 1)]
    return {
        "number": number,
        "dataset": question.dataset.replace("_", " "),
        "task": TASKS[question.follows][max(len(words), len(question.pictures)) > 1],
        "words": words,
        "pictures": [picture_uri(path) for path in question.pictures],
        "original": places[0],
        "options": [
            {"letter": letter, **place} for letter, place in zip(question.letters, places[1:], strict=True)
        ],
        "ranks": [rank_name(rank, count) for rank in range(1, count + 1)],
        "film": base64.b64encode(film).decode(),
    }


def picture_uri(path: str) -> str:
    """Return a small copy of a picture as a data URI, without metadata."""
    file = io.BytesIO()
    with open_picture(path) as picture:
        small = picture.convert("RGB")
    small.thumbnail((PICTURE, PICTURE))
    small.save(file, format="JPEG", quality=90)
    return f"data:image/jpeg;base64,{base64.b64encode(file.getvalue()).decode()}"


def policy_hash(text: str) -> str:
    """Return the hash of a style or script for a Content-Security-Policy."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def text_of(name: str) -> str:
    """Read a file beside this one."""
    return files("texgs.study").joinpath(name).read_text(encoding="utf-8")
