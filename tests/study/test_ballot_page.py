"""The page that voters get."""

import base64
import hashlib
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from tests.report.written import Page
from tests.study.studies import study
from texgs.study.ballot_page import ballot_page, picture_uri

TWO = study("xyz", "yx").questions
TEXT = study("xy", follows="instruction").questions
FILM = b"not a film"


@pytest.fixture
def picture(tmp_path):
    image = Image.fromarray(np.full((400, 800, 3), (200, 0, 0), dtype=np.uint8))
    image.save(tmp_path / "style.png", comment="a secret")
    return str(tmp_path / "style.png")


def test_every_option_has_a_radio_button_for_every_rank():
    page = Page(ballot_page("abc", TWO, [FILM, FILM], 64))
    radios = [(each["name"], each["value"]) for each in page.all("input") if each["type"] == "radio"]
    assert radios == [
        *((f"1-{letter}", rank) for letter in "ABC" for rank in "123"),
        *((f"2-{letter}", rank) for letter in "AB" for rank in "12"),
    ]
    assert [each["data-letter"] for each in page.all("fieldset")] == [*"ABC", *"AB"]
    assert page.of("legend") == [f"Clip {letter}" for letter in "ABCAB"]
    places = [(each["data-column"], each["data-row"]) for each in page.all("canvas")]
    assert len(set(places[:4])) == 4, "the scene before the edits and three options"
    assert all(each["aria-label"] and each["role"] == "img" for each in page.all("canvas"))
    assert [base64.b64decode(text) for text in page.of("template")] == [FILM, FILM]


def test_nothing_is_loaded_and_only_its_own_style_and_script_run(picture):
    questions = [replace(TWO[0], pictures=[picture])]
    text = ballot_page("abc", questions, [FILM], 64)
    page = Page(text)
    policy = next(each["content"] for each in page.all("meta") if each.get("http-equiv"))
    assert policy.startswith("default-src 'none'; img-src data:; media-src blob:; style-src")
    assert "unsafe" not in policy
    for tag in ("style", "script"):
        (inside,) = re.findall(rf"<{tag}>(.*?)</{tag}>", text, flags=re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(inside.encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}'" in policy
    assert not re.search(r"https?:|//[a-z]|\bfetch\(|url\(|@import", text)
    assert not re.search(r"\son[a-z]+=|\sstyle=", text), "what the policy would stop"
    assert all(each["src"].startswith("data:image/jpeg;base64,") for each in page.all("img"))


def test_pictures_and_instructions_are_told_as_text(picture):
    one = [replace(TWO[0], pictures=[picture])]
    assert "The new looks follow this picture." in ballot_page("abc", one, [FILM], 64)
    two = [replace(TWO[0], pictures=[picture, picture])]
    assert "The new looks follow these pictures, each in a part." in ballot_page("abc", two, [FILM], 64)
    hostile = {"TF01": "<script>alert(1)</script>", "TF02": 'a "b"', "TF03": 'a "b"'}
    text = ballot_page("abc", [replace(TEXT[0], followed=hostile)], [FILM], 64)
    assert "<q>&lt;script&gt;alert(1)&lt;/script&gt;</q>, <q>a &#34;b&#34;</q>" in text
    assert text.count("<script>") == 1


def test_pictures_are_small_and_hold_nothing_but_pixels(picture):
    data = base64.b64decode(picture_uri(picture).partition(",")[2])
    assert b"secret" not in data
    assert len(data) < 4000


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium: apt-get install chromium")
def test_a_browser_shows_the_first_question_from_a_file(tmp_path):
    path = tmp_path / "ballot.html"
    path.write_text(ballot_page("abc", TWO, [FILM, FILM], 64))
    options = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path}", "--dump-dom"]
    done = subprocess.run(["chromium", *options, path.as_uri()], capture_output=True, text=True, timeout=300)
    sections = [each for each in Page(done.stdout).all("section") if each["class"] == "question"]
    assert ["hidden" in each for each in sections] == [False, True], "the script has run"
