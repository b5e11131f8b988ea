import base64
import io
import json
import re
from urllib.parse import unquote

import pytest
from PIL import Image

from tests.report.written import Page, job
from tests.study.studies import study
from texgs.report.differences import differences_of
from texgs.report.html import write_report as write_records
from texgs.report.metrics_files import LeftOut, read_known
from texgs.report.results import (
    SECTIONS,
    ComparisonResult,
    EditResult,
    FitResult,
    GalleryResult,
    PageResult,
    PseResult,
    SheetResult,
    TimingResult,
)
from texgs.study.ballots import Ballot, Votes
from texgs.study.votes import study_table, votes_figure


@pytest.fixture
def folder(tmp_path):
    """Of the jobs."""
    (folder := tmp_path / "jobs").mkdir()
    return folder


@pytest.fixture
def paths(folder):
    edit = EditResult("painted", "image", "how", 6.0, follows="style", followed={"TF01": "strokes"})
    part = EditResult("red", "text", "how", 6.0, follows="instruction", followed={"TF01/lobe": "red"})
    timing = TimingResult(4.0, 5.0, 4.0, primitives=9, width=8, height=6, threads=2)
    comparison, sheet = ComparisonResult(["a", "b"], ["0"]), SheetResult(9, 2, 8, 4)
    command = "texgs sheet experiment=mine 'fits=[a,b]' tf=TF01"
    return [
        job(folder, "gallery", GalleryResult("image", []), ["gallery.png"], recipe=None),
        job(folder, "timing", timing),
        job(folder, "edit_text", part, ["edit.png"], recipe="other"),
        job(folder, "edit_image", edit, ["edit.png", "style-TF01.png"]),
        job(folder, "pse", PseResult(6, [], []), ["pse.png", "relight.png"]),
        job(folder, "texture", FitResult(60.0, 9, 10, [2.0, 1.0]), tf="TF01"),
        job(folder, "comparison", comparison, ["comparison.png"], tf="TF01", recipe=None),
        job(folder, "sheet", sheet, ["sheet.png"], tf="TF01", recipe=None, command=command),
        job(folder, "star_plot", timing, ["new.png"], recipe=None),
    ]


def write_report(path, paths, left_out=(), votes=None):
    """A report of metrics files with all tables, as `texgs report` writes it."""
    found, old = read_known(paths)
    given = {"user_study": study_table(found, votes), "differences": differences_of(found)}
    more = {} if given["user_study"].is_empty else {"study": [votes_figure(votes)]}
    return write_records(path, found, [*left_out, *old], given, more)


def page(tmp_path, paths, left_out=()):
    return Page(write_report(tmp_path / "report.html", paths, left_out).read_text())


def test_sections_are_in_the_papers_order_and_every_link_leads_somewhere(tmp_path, paths):
    document = page(tmp_path, paths)
    keys = [key for key in document.values("id") if key in SECTIONS]
    assert keys == [key for key in SECTIONS if key in keys]
    assert set(SECTIONS) - set(keys) == {"scenes", "time", "text", "ablations", "sizes"}, "they are empty"
    ids, links = document.values("id"), document.values("href")
    assert len(ids) == len(set(ids))
    assert {link for link in links if not link.startswith("#")} == set()
    assert {link[1:] for link in links} <= set(ids)


def test_every_figure_has_its_words_and_command(tmp_path, paths):
    document = page(tmp_path, paths)
    captions = " ".join(document.of("figcaption"))
    names = ["gallery", "edit", "style-TF01", "pse", "relight", "comparison", "sheet", "new"]
    assert all(f"Words of {name}.png." in captions for name in names)
    assert document.of("code").count("texgs sheet experiment=mine 'fits=[a,b]' tf=TF01") == 1
    assert len(document.values("src")) == 11, "nine pictures, the curve of the fit and the paper's votes"
    for source in document.values("src"):
        kind, data = source.split(";base64,")
        assert kind == "data:image/webp"
        assert Image.open(io.BytesIO(base64.b64decode(data))).format == "WEBP"


def test_figures_of_sweeps_are_galleries_alone(tmp_path, folder):
    of_sweep = {"sweep": "resolution", "variant": "400"}
    grid = job(folder, "gallery", GalleryResult("ablations", []), ["resolution.png"], **of_sweep)
    single = job(folder, "figure", SheetResult(9, 2, 8, 4), ["figure.png"], **of_sweep)
    captions = " ".join(page(tmp_path, [grid, single]).of("figcaption"))
    assert "Words of resolution.png." in captions
    assert "Words of figure.png." not in captions


def test_figures_are_in_their_sections(tmp_path, paths):
    text = write_report(tmp_path / "report.html", paths).read_text()
    places = {match[1]: match.start() for match in re.finditer(r'<h2 id="([a-z-]+)"', text)}
    bounds = sorted(places.values())

    def section(words):
        start = max(place for place in bounds if place < text.index(words))
        return next(key for key, place in places.items() if place == start)

    assert section("Words of sheet.png") == "data"
    assert section("Words of comparison.png") == "fitting"
    assert section("Words of relight.png") == "relight"
    assert section("Words of gallery.png") == "image", "as its experiment says"
    assert section("Words of style-TF01.png") == "image"
    assert section("Words of new.png") == "more", "a stage that no section names"
    assert section("<b>other red</b>") == "parts", "it follows words, but for a segment"


def test_votes_have_their_table_and_figure(tmp_path, paths):
    votes = Votes(study("xy"), [Ballot("a", [[1, 2]])])
    text = write_report(tmp_path / "report.html", paths, votes=votes).read_text()
    assert "1 ballots" in text
    assert "<code>texgs votes</code>" in text
    assert '<tr class="theirs">' in text
    assert "<tr><td" in text


def test_rows_lead_to_their_jobs(tmp_path, paths):
    document = page(tmp_path, paths)
    timing = sorted(paths).index(paths[1]) + 1
    assert document.values("href").count(f"#job-{timing}") == 1
    jobs = [key for key in document.values("id") if key.startswith("job-")]
    assert jobs == [f"job-{number}" for number in range(1, 10)]


def test_what_was_left_out_stands_on_top(tmp_path, paths):
    old = tmp_path / "old.json"
    old.write_text('{"stage": "texture", "dataset": "engine", "numbers": {"surfels": 9}}')
    document = page(tmp_path, [*paths, old], [LeftOut("data set wood", "no <file>", ["phase"])])
    assert document.values("id")[0] == "left-out"
    first, second = document.of("li")[:2]
    assert first == "data set wood: no <file>."
    assert second.startswith("1 metrics file: of another version of texgs")
    assert "left-out" not in page(tmp_path, paths).values("id")


def test_a_scene_opens_in_the_report_where_it_is_small_and_elsewhere_by_a_link(tmp_path, folder):
    """What stands in a page cannot end the script that holds it."""
    text = "<!doctype html><script>let a = '<\\/script>';</script>"
    paths = []
    for name, is_embedded in (("small", True), ("large scene", False)):
        (folder / name).mkdir()
        path = job(folder / name, "page", PageResult("gold", 9, 1.0, is_embedded), ["poster.png"])
        path.with_name("scene.html").write_text(text)
        paths.append(path)
    report = write_report(tmp_path / "report.html", paths).read_text()
    ((held),) = re.findall(r'<script type="application/json">(.*?)</script>', report)
    assert json.loads(held) == text
    (link,) = re.findall(r'class="open" href="([^"]*)"', report)
    assert (tmp_path / unquote(link)).read_text() == text
