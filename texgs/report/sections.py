"""The figures of each section of the report, and the pages of scenes that it holds."""

import base64
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PIL import Image

from texgs.core.names import PAGE
from texgs.edit.method import NO_METHOD
from texgs.report.edit_tables import words_of
from texgs.report.metrics_files import Record, of
from texgs.report.published import in_order
from texgs.report.results import SECTIONS, EditResult, GalleryResult, PageResult

SECTIONS_OF_EDITS = {"style": "image", "instruction": "text", "": "parts"}  # by what they follow
NARROW_WIDTH = 1000  # pixels; narrower pictures stand side by side
AS_FITTED = "as fitted"  # label of a scene without an edit
MAILED = 17 * 10**6  # bytes of pages in a report, which with tables is then 25 MB as an attachment
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
    page: Path | None = None  # file of a page with the same scene


def figures(records: Sequence[Record[Any]]) -> dict[str, list[Figure]]:
    """Return all pictures of jobs by section, in order; for sweeps, only pictures of all variants.

    Scenes as fitted come before edits.
    """
    by_section: dict[str, list[Figure]] = {name: [] for name in SECTIONS}
    has_one = len({record.label for record in records if record.label}) == 1
    edits = {(each.dataset, each.label, each.result.edit): each.result for each in of(EditResult, records)}
    for record in sorted(in_order(records), key=lambda each: edit_of(each) not in ("", AS_FITTED)):
        is_of_all = isinstance(record.result, GalleryResult) or not record.is_swept
        for name, words in record.facts.get("pictures", {}).items() if is_of_all else ():
            file = record.path.with_name(name)
            edit = edits.get((record.dataset, record.label, edit_of(record)))
            if edit and edit.followed and isinstance(record.result, PageResult):
                words = f"It follows: {words_of(edit.followed)}."
            if file.is_file() and (figure := figure_of(record, file, words, has_one)):
                by_section[section_of(record, file)].append(figure)
    return by_section


def figure_of(record: Record[Any], file: Path, words: str, has_one: bool) -> Figure | None:
    """Return a picture of a job, with the page if it has one; None for films, which are too large."""
    with Image.open(file) as picture:
        if getattr(picture, "is_animated", False):
            return None
        uri, is_narrow = data_uri(picture), picture.width <= NARROW_WIDTH
    command = str(record.facts.get("command", ""))
    page = record.path.with_name(PAGE) if isinstance(record.result, PageResult) else None
    own = page if page and page.is_file() else None
    return Figure(record.title, label(record, has_one), words, uri, command, is_narrow, own)


def held_pages(shown: Sequence[Figure]) -> dict[Path, str]:
    """Return the pages that a report with some figures holds, as JSON by file: the smallest, to `MAILED`."""
    room, held = MAILED - sum(len(figure.uri) for figure in shown), dict[Path, str]()
    pages = [figure.page for figure in shown if figure.page]
    for page in sorted(pages, key=lambda page: page.stat().st_size):
        text = json.dumps(page.read_text(encoding="utf-8")).replace("</", r"<\/")
        if (room := room - len(text)) < 0:
            break
        held[page] = text
    return held


def section_of(record: Record[Any], picture: Path) -> str:
    """Return the section of a picture: by its name, or by the job's result."""
    result = record.result
    if isinstance(result, EditResult):
        is_part = any("/" in name for name in result.followed)
        return "parts" if is_part else SECTIONS_OF_EDITS[result.follows]
    if isinstance(result, GalleryResult):
        return result.section
    return picture.stem if picture.stem in SECTIONS else result.pictured_in


def label(record: Record[Any], has_one: bool) -> str:
    """Return a label of a job: basic TF, fit, unless the report has one, and edit, if any."""
    return " ".join(filter(None, (record.tf, "" if has_one else record.label, edit_of(record))))


def edit_of(record: Record[Any]) -> str:
    """Return the edit of a job that made a scene or its page, or that it is as fitted; "" for other jobs."""
    edit = record.result.edit if isinstance(record.result, EditResult | PageResult) else ""
    return AS_FITTED if edit == NO_METHOD else edit


def data_uri(picture: Image.Image) -> str:
    """Return a picture as a data URI, compressed to about an eighth of its PNG."""
    file = io.BytesIO()
    picture.convert("RGBA").save(file, format="WEBP", quality=WEBP_QUALITY, method=WEBP_EFFORT)
    return f"data:image/webp;base64,{base64.b64encode(file.getvalue()).decode()}"
