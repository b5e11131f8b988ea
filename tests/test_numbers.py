"""Numbers of the README and of docs/ are in the results that their section links.

Checked are decimals in tables of docs/accuracy.md, and numbers with a unit on every page. A section that
links another page may have its numbers. What this cannot see: whether a number is that of the right row,
whole numbers without a unit, numbers in words, and what a sentence concludes from them.
"""

import json
import re
from bisect import bisect_left
from itertools import combinations

import pandas as pd
import pytest

from benchmarks.results import DOCS, RESULTS, pages
from texgs.models.catalogue import CATALOGUE

SCALES = {  # of what files hold, by the units of the pages
    "s": (1, 60, 1e-3),  # minutes, milliseconds
    "seconds": (1, 60, 1e-3),
    "minutes": (1, 1 / 60),
    "ms": (1, 1e3),
    "dB": (1,),
    "MiB": (1, 2**-20),
    "GiB": (1, 2**-10),
    "MB": (1, 1e-6),
    "GB": (1, 1e-3),
    "frames a second": (1,),
    "%": (1, 100),
}
ELSEWHERE = {  # page: numbers that are of no measurement, and what they are of
    "api.md": {"24 MB"},  # texgs/api/scene.py
    "data.md": {"0.64 GiB", "2.1 GiB", "16 GiB", "256 GiB", "6 %"},  # files of others, an example
    "looks.md": {  # texgs/models/catalogue.py
        *(f"{size} MB" for size in (553, 41, 605, 29)),
        *(f"{size} GB" for size in (2.6, 1.7, 4.3, 12.6, 16.0, 57.7)),
    },
    "report.md": {"95 %"},  # an interval
    "workflow.md": {"16 GB", "24 GB", "3 MB"},  # the profile of SLURM, a file of others
}
NUMBER = r"(?<![\w.#-])\d[\d,]*(?:\.\d+)?"
CLAIM = re.compile(rf"({NUMBER})(?: (?:to|and|\+) ({NUMBER}))? ?({'|'.join(SCALES)})(?!\w)")


def sections(text):
    """A page in parts that begin with a heading, without code, and the targets of their links."""
    text = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    for part in re.split(r"^(?=#+ )", text, flags=re.MULTILINE):
        targets = re.findall(r"\]\(([^)]+)\)", part)
        yield re.sub(r"`[^`]*`|\]\([^)]*\)", "", part), targets


def numbers(value):
    """All numbers of what JSON holds, those inside of texts too."""
    if isinstance(value, str):
        return {float(each) for each in re.findall(r"\d+(?:\.\d+)?", value)}
    if isinstance(value, dict | list):
        inner = value.values() if isinstance(value, dict) else value
        return set().union(*map(numbers, inner))
    return {float(value)} if isinstance(value, int | float) and value == value else set()


def in_file(path):
    """Numbers of a file; of a table also means and sums over the rows that are alike, and MiB of a row."""
    if path.suffix == ".json":
        return numbers(json.loads(path.read_text()))
    table = pd.read_csv(path)
    values = table.select_dtypes("number")
    found = numbers(table.values.tolist()) | numbers(values.filter(regex="MiB$").sum(axis=1).tolist())
    texts = [column for column in table if column not in values]
    for keys in (*combinations(texts, 1), *combinations(texts, 2)):
        groups = table.groupby(list(keys))[list(values)]
        found |= numbers(groups.mean().values.tolist()) | numbers(groups.sum().values.tolist())
    return found


def known(targets):
    """Numbers of the results and of the pages that a section links, sorted."""
    paths = {(DOCS / target.partition("#")[0]).name for target in targets if not target.startswith("http")}
    files = [RESULTS / name for name in paths if (RESULTS / name).is_file()]
    texts = [text for name in paths if name.endswith(".md") and (text := page_text(name))]
    written = {float(each.replace(",", "")) for text in texts for each in re.findall(NUMBER, text)}
    return sorted(set().union(written, *map(in_file, files)))


def page_text(name):
    """What a page of docs says, without its links; nothing of another page."""
    return " ".join(text for text, _ in sections((DOCS / name).read_text())) if (DOCS / name).exists() else ""


def is_known(number, scales, among):
    """Whether it is one of these, rounded as it is written."""
    value, digits = float(number.replace(",", "")), len(number.partition(".")[2])
    half = 0.5 * 10**-digits * (1 + 1e-6)
    places = [(bisect_left(among, (value - half) / scale), (value + half) / scale) for scale in scales]
    return any(place < len(among) and among[place] <= most for place, most in places)


def claims(page, text):
    """Numbers of a part of a page that need a source, with their unit and its scales."""
    for first, second, unit in CLAIM.findall(text):
        yield from ((number, unit, SCALES[unit]) for number in (first, second) if number)
    if page == "accuracy.md":
        for row in re.findall(r"^\|.*", text, flags=re.MULTILINE):
            yield from ((number, "", (1,)) for number in re.findall(rf"{NUMBER}", row) if "." in number)


def unknown(page, text):
    """Numbers of a page that are neither in a file that their section links nor from elsewhere."""
    for part, targets in sections(text):
        among, title = known(targets), part.partition("\n")[0]
        for number, unit, scales in claims(page, part):
            told = f"{number} {unit}".strip()
            if not is_known(number, scales, among) and told not in ELSEWHERE.get(page, ()):
                yield f"{title}: {told}"


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_numbers_of_a_page_are_in_files_that_it_links(page):
    assert not sorted(unknown(page.name, page.read_text(encoding="utf-8")))


@pytest.mark.parametrize("page", ELSEWHERE)
def test_numbers_from_elsewhere_are_on_their_page(page):
    written = {f"{number} {unit}" for number, unit, _ in claims(page, page_text(page))}
    assert written >= ELSEWHERE[page]


def test_sizes_of_weights_are_those_of_the_catalogue():
    rows = re.findall(
        r"^\| `([\w-]+)` \| ([\d.]+) (kB|MB|GB) \|", (DOCS / "looks.md").read_text(), re.MULTILINE
    )
    assert {name for name, _, _ in rows} == CATALOGUE.keys()
    for name, size, unit in rows:
        scale = {"kB": 1e3, "MB": 1, "GB": 1e-3}[unit]
        assert is_known(size, (scale,), [CATALOGUE[name].megabytes]), name


@pytest.mark.parametrize(
    ("page", "text", "found"),
    [
        ("accuracy.md", "| TF01 | 3.14159 | ([a](FILE)) |", ["3.14159"]),
        ("accuracy.md", "| TF01 | 2.7183 | ([a](FILE)) |", []),
        ("README.md", "It reaches 2.718 dB ([a](FILE)).", []),
        ("README.md", "It reaches 2.719 dB ([a](FILE)).", ["2.719 dB"]),
        ("README.md", "It reaches 2.7 dB.", ["2.7 dB"]),  # in no file that is linked
        ("README.md", "It takes 60 to 90 s ([a](FILE)).", ["90 s"]),  # one minute
        ("README.md", "Both take 5.0 MiB ([a](FILE)).", []),  # of 3 and 2 in a row
        ("README.md", "On average 2 dB ([a](FILE)).", []),  # of 1 and 3 of one recipe
        ("README.md", "With `views.width=400 MiB` and [a](9 MB).", []),
        ("README.md", "The engine, 38 GB", ["38 GB"]),
    ],
)
def test_a_number_without_source_is_found(page, text, found, monkeypatch, tmp_path):
    table = tmp_path / "table.csv"
    table.write_text("recipe,psnr,minutes,MiB,more MiB\nquick,1,1,3,2\nquick,3,7,2.71828,0\n")
    monkeypatch.setitem(globals(), "RESULTS", tmp_path)
    assert [each.rpartition(": ")[2] for each in unknown(page, text.replace("FILE", table.name))] == found
