import base64
import io
import json
import re
from urllib.parse import unquote

import pytest
from PIL import Image

from tests.report.written import Page, job
from tests.study.studies import study
from texgs.report import sections
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
    SceneResult,
    SheetResult,
    TimingResult,
    VolumeResult,
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


def test_sections_are_in_order_and_every_link_leads_somewhere(tmp_path, paths):
    document = page(tmp_path, paths)
    keys = [key for key in document.values("id") if key in SECTIONS]
    assert keys == [key for key in SECTIONS if key in keys]
    empty = {"scenes", "time", "text", "ablations", "sizes"}
    assert set(SECTIONS) - set(keys) == {"overview"} | empty
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


def pages_of(folder, sizes):
    """Metrics of pages of scenes, by edit, whose files have so many bytes."""
    paths = []
    for edit, size in sizes.items():
        (folder / f"a {edit}").mkdir()
        path = job(folder / f"a {edit}", "page", PageResult(edit, 9, 1.0), ["poster.png"])
        path.with_name("scene.html").write_text("<script>'<\\/script>'</script>".ljust(size))
        paths.append(path)
    return paths


def test_small_scenes_are_in_the_report_and_it_says_which_are_beside_it(tmp_path, folder, monkeypatch):
    """All open by the same button; what stands in a page cannot end the script that holds it."""
    paths = pages_of(folder, {"gold": 9_000, "glass": 3_000, "none": 2_000, "huge": 30_000_000})
    monkeypatch.setattr(sections, "MAILED", 8_000)
    report = write_report(tmp_path / "report.html", paths)
    text = report.read_text()
    held = [json.loads(page) for page in re.findall(r'<script type="application/json">(.*?)</script>', text)]
    assert sorted(map(len, held)) == [2_000, 3_000], "the smallest, as long as there is room"
    assert all(page.startswith("<script>'<\\/script>'</script>") for page in held)
    assert text.count('<button type="button" class="open"') == 4
    beside = re.findall(r'This scene is a file beside the report, of ([\d.]+) MB: <a href="([^"]*)"', text)
    assert [size for size, _ in beside] == ["0.0", "30.0"]
    assert all((tmp_path / unquote(link)).is_file() for _, link in beside)


def test_a_report_that_holds_pages_can_be_mailed(tmp_path, folder):
    """A mail of 25 MB holds four thirds of an attachment, and line ends."""
    paths = pages_of(folder, {f"e{number}": 4_000_000 for number in range(6)})
    size = write_report(tmp_path / "report.html", paths).stat().st_size
    assert 16e6 < size < 18.1e6
    assert size * 4 / 3 * 78 / 76 < 25e6


def test_the_scene_as_fitted_comes_first_and_recipes_are_named_where_there_are_two(tmp_path, folder):
    paths = pages_of(folder, {"crimson": 100, "none": 100, "glass": 100})
    style = EditResult("glass", "image", "how", 6.0, follows="style", followed={"a": "panes", "b": "panes"})
    document = page(tmp_path, [*paths, job(folder, "edit_image", style)])
    assert document.of("b") == ["as fitted", "crimson", "glass"]
    captions = [text for text in document.of("figcaption") if text.startswith(": ")]
    assert captions[0] == ": Words of poster.png."
    assert captions[2] == ": It follows: panes."
    other = job(folder, "pse", PseResult(6, [], []), ["pse.png"], recipe="other")
    assert {"quick as fitted", "other"} < set(page(tmp_path, [*paths, other]).of("b"))


def own_run(folder, shown=1.0, dataset="mine"):
    """Jobs of a volume with two functions, of which the first shows a share; the paper has no such data."""
    volume = VolumeResult([9, 8, 7], "uint8", [1.0] * 3, [0.0] * 3, 0.0, 1.0, 504, 0.1)
    facts = {"dataset": dataset, "seconds": 10.0}
    paths = [job(folder, "volume", volume, recipe="", **facts)]
    for tf, level in (("TF01", 40.0), ("TF02", 20.0)):
        for stage in ("surfels", "shading", "texture"):
            sizes = {"geometry_mib": 1.0, "shading_mib": 1.0, "texture_mib": 1.0}
            last = {
                "psnr": 45.0,
                "object_psnr": level,
                "shown": shown if tf == "TF01" else 1.0,
                "sizes": sizes,
            }
            paths.append(job(folder, stage, FitResult(2.0, 9, **last), tf=tf, **facts))
    pictures = ["scene.png", "volume.png"]
    return [*paths, job(folder, "compose", SceneResult(2, 1234), pictures, **facts)]


def test_a_report_begins_with_pictures_and_three_sentences(tmp_path, folder):
    document = page(tmp_path, own_run(folder))
    assert document.of("h1") == ["mine"]
    what, quality, time = document.of("p")[:3]
    assert what == "A volume of 9 × 8 × 7 samples, shown by TF01, TF02, as a scene of 1,234 surfels."
    assert "off by about 3.2 % of full brightness (30.0 dB; TF02 has the least with 20.0 dB)." in quality
    assert quality.endswith("Nothing is missing: the scene shows 100.0 % of what is there.")
    assert time == "All jobs took 1 min 20 s, added up, 12 s of it for fits, on CPU."
    assert document.values("alt")[:2] == ["mine: Words of scene.png.", "mine: Words of volume.png."]
    first = document.values("id")
    assert first[0] == "contents"


def test_of_several_recipes_the_one_that_is_told_of_is_named(tmp_path, folder):
    other = job(folder, "compose", SceneResult(2, 99), [], recipe="slow", dataset="mine", seconds=10.0)
    told = page(tmp_path, [*own_run(folder), other]).of("p")[0]
    assert told.endswith("as a scene of 1,234 surfels by quick.")


def test_missing_parts_are_told_first(tmp_path, folder):
    assert (
        "Parts are missing: the scene shows 91.2 % of what is there."
        in page(tmp_path, own_run(folder, 0.912)).of("p")[1]
    )


def test_a_data_set_without_a_fit_is_told_too(tmp_path, folder):
    sheet = job(folder, "sheet", SheetResult(9, 2, 8, 4), ["sheet.png"], tf="TF01", recipe="", dataset="mine")
    words = page(tmp_path, [sheet]).of("p")[:2]
    assert words == ["Views, shown by TF01.", "All jobs took 1 s, added up, 0 s of it for fits, on CPU."]


def test_a_data_set_without_a_scene_stands_behind(tmp_path, folder):
    volume = VolumeResult([9, 8, 7], "uint8", [1.0] * 3, [0.0] * 3, 0.0, 1.0, 504, 0.1)
    paths = [job(folder, "volume", volume, recipe="", dataset="another"), *own_run(folder)]
    assert page(tmp_path, paths).of("h2")[:2] == ["mine", "another"]


def test_own_data_have_plain_titles(tmp_path, folder):
    """The paper's numbers of tables, and where we differ from it, stand beside its data alone."""
    own = page(tmp_path, own_run(folder))
    titles = own.of("h3")
    assert "Quality of the fits, phase by phase" in titles
    assert not [text for _, text in own.texts if "paper" in text.lower()]
    assert "differences" not in own.values("id")
    (theirs := tmp_path / "theirs").mkdir()
    document = page(tmp_path, own_run(theirs, dataset="engine"))
    assert "Quality of the fits, phase by phase (Table A5 of the paper)" in document.of("h3")
    assert "differences" in document.values("id")
