"""The sections of the report in the paper's order, and the figures of each."""

import base64
import io
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from PIL import Image

from texgs.core.names import PAGE
from texgs.edit.method import NO_METHOD
from texgs.report.metrics_files import Record
from texgs.report.published import in_order
from texgs.report.results import SECTIONS, EditResult, GalleryResult, PageResult

SECTIONS_OF_EDITS = {"style": "image", "instruction": "text", "": "parts"}  # by what they follow
NARROW_WIDTH = 1000  # pixels; narrower pictures stand side by side
WEBP_QUALITY, WEBP_EFFORT = 85, 2  # full quality is in the folders of jobs


@dataclass(frozen=True)
class Figure:
    """A picture with its description."""

    dataset: str
    label: str  # basic TF, fit and edit
    words: str
    uri: str
    command: str  # command line that makes it
    is_narrow: bool = False
    page: str = ""  # page with the same scene, as JSON; or
    link: str = ""  # path of the page


def figures(records: Sequence[Record[Any]], folder: Path) -> dict[str, list[Figure]]:
    """Return all pictures of jobs by section and data set; for sweeps, only pictures of all variants.

    Links to larger pages begin at the folder of the report.
    """
    by_section: dict[str, list[Figure]] = {name: [] for name in SECTIONS}
    for record in in_order(records):
        is_of_all = isinstance(record.result, GalleryResult) or not record.is_swept
        for name, words in record.facts.get("pictures", {}).items() if is_of_all else ():
            file = record.path.with_name(name)
            if file.is_file() and (figure := figure_of(record, file, words, folder)):
                by_section[section_of(record, file)].append(figure)
    return by_section


def figure_of(record: Record[Any], file: Path, words: str, folder: Path) -> Figure | None:
    """Return a picture of a job, with a page or a link from a folder; None for films, which are too large."""
    with Image.open(file) as picture:
        if getattr(picture, "is_animated", False):
            return None
        uri, is_narrow = data_uri(picture), picture.width <= NARROW_WIDTH
    command = str(record.facts.get("command", ""))
    return Figure(record.title, label(record), words, uri, command, is_narrow, *page(record, folder))


def page(record: Record[Any], folder: Path) -> tuple[str, str]:
    """Return the page of a scene, or a link to it, if a job has made one; the other is empty."""
    file = record.path.with_name(PAGE)
    if not isinstance(record.result, PageResult) or not file.is_file():
        return "", ""
    if record.result.is_embedded:
        return json.dumps(file.read_text(encoding="utf-8")).replace("</", r"<\/"), ""
    return "", quote(Path(os.path.relpath(file, folder)).as_posix())


def section_of(record: Record[Any], picture: Path) -> str:
    """Return the section of a picture: by its name, or by the job's result."""
    result = record.result
    if isinstance(result, EditResult):
        is_part = any("/" in name for name in result.followed)
        return "parts" if is_part else SECTIONS_OF_EDITS[result.follows]
    if isinstance(result, GalleryResult):
        return result.section
    return picture.stem if picture.stem in SECTIONS else result.pictured_in


def label(record: Record[Any]) -> str:
    """Return a label of a job: basic TF, fit and edit, if any."""
    return " ".join(filter(None, (record.tf, record.label, edit_of(record))))


def edit_of(record: Record[Any]) -> str:
    """Return the edit of a job that made a scene or its page, if any."""
    edit = record.result.edit if isinstance(record.result, EditResult | PageResult) else ""
    return "" if edit == NO_METHOD else edit


def data_uri(picture: Image.Image) -> str:
    """Return a picture as a data URI, compressed to about an eighth of its PNG."""
    file = io.BytesIO()
    picture.convert("RGBA").save(file, format="WEBP", quality=WEBP_QUALITY, method=WEBP_EFFORT)
    return f"data:image/webp;base64,{base64.b64encode(file.getvalue()).decode()}"
