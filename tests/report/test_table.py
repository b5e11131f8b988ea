"""Tables as files; their LaTeX compiles: by pdflatex where there is one, and by its grammar everywhere."""

import csv
import io
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from texgs.report.table import SOURCES, UNLIKE_CELL, Column, Table, escape, write_tables

TABLE = Table(
    "A caption.",
    (Column("name"), Column("dB", 2)),
    [{"name": "five_jets", "dB": 36.834, SOURCES: [Path("a/metrics.json")]}, {"name": "wood | stone"}],
)
HARD = r"50 % of $x_1$ & #2 {a} ~ ^ \ <|> [b] 'c' ± × λ β ≠ → é Ł µ 中 🎉"
HARD_TABLE = Table(
    f"A caption with {HARD}\nin two lines.",
    (Column(HARD), Column("± PSNR", 2)),
    [
        {HARD: "[first", "± PSNR": 1.0},
        {HARD: HARD},
        {HARD: "two\nlines", "± PSNR": 2.0, SOURCES: [Path("a_b")]},
    ],
    heading=f"Heading {HARD}",
)
COMMAND = re.compile(r"\\(?:[A-Za-z]+|.)", re.DOTALL)


def test_csv_keeps_all_digits_and_leaves_gaps():
    assert list(csv.reader(io.StringIO(TABLE.csv()))) == [
        ["name", "dB", "metrics files"],
        ["five_jets", "36.834", "a/metrics.json"],
        ["wood | stone", "", ""],
    ]
    unlike = Table("", TABLE.columns, [{"name": "a", "dB": UNLIKE_CELL}])
    assert unlike.csv().splitlines()[1] == "a,,", "columns of numbers stay such"


def test_markdown_says_what_was_not_measured():
    assert "| five_jets | 36.83 |" in TABLE.markdown()
    assert r"| wood \| stone | not measured |" in TABLE.markdown(), "a bar would begin a cell"
    assert Column("primitives", 0).text(1234567) == "1,234,567"
    assert TABLE.markdown().endswith("\n\nA caption.\n")
    broken = Table("two\nlines", TABLE.columns, [{"name": "a\nb", "dB": 1.0}], "Heading")
    assert broken.markdown().splitlines()[4:] == ["| a b | 1.00 |", "", "two lines"]


def test_rows_keep_their_files_in_whatever_order_they_come():
    frame = TABLE.frame.iloc[::-1]
    table = Table("", TABLE.columns, frame)
    assert table.frame["metrics files"][1] == [Path("a/metrics.json")]
    assert table.frame["name"][0] == "wood | stone"


def check_grammar(text):
    """Require balanced environments and braces, equal rows, and no letter that has a meaning of its own."""
    lines = [line for line in text.splitlines() if not line.startswith("%")]
    body = "\n".join(lines)
    opened = []
    for kind, name in re.findall(r"\\(begin|end)\{(\w+)\}", body):
        if kind == "begin":
            opened.append(name)
        else:
            assert opened.pop() == name
    assert not opened
    bare = COMMAND.sub("", body)
    assert bare.count("{") == bare.count("}")
    assert bare.count("$") % 2 == 0
    assert not re.search(r"[#~]", bare)
    assert not re.search(r"[_^]", re.sub(r"\$[^$]*\$", "", bare)), "only inside of formulas"
    assert all(letter.isascii() or letter in "éŁ" for letter in body)


def test_a_table_has_equal_rows_and_escapes_every_special_letter():
    text = HARD_TABLE.latex()
    check_grammar(text)
    rows = [line for line in text.splitlines() if line.endswith(r" \\")]
    assert len(rows) == 4
    for row in rows:
        assert len(re.findall(r"(?<!\\)&", row)) == 1
        assert not row.lstrip().startswith("["), "it would be an argument of the row before"
    assert re.findall(r"\\begin\{tabular\}\{(\w+)\}", text) == ["lr"]
    assert re.findall(r"\\(\w+rule)", text) == ["toprule", "midrule", "bottomrule"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("five_jets", r"five\_jets"),
        ("± PSNR", r"$\pm$ PSNR"),
        ("λ_s", r"$\lambda$\_s"),
        ("a\\b", r"a\textbackslash{}b"),
        ("Ł中", r"Ł\texttt{U+4E2D}"),
    ],
)
def test_text_is_printed_as_it_is(text, expected):
    assert escape(text) == expected


def test_the_document_has_the_tables_with_rows_and_their_captions(tmp_path):
    write_tables(tmp_path, {"hard": HARD_TABLE, "empty": Table("none", HARD_TABLE.columns, [])})
    text = (tmp_path / "tables.tex").read_text()
    check_grammar(text[text.index(r"\begin{document}") :])
    assert re.findall(r"\\fitted\{(.*?)\}", text) == ["hard.tex"]
    assert escape(HARD_TABLE.caption) in text


def test_pdflatex_takes_it(tmp_path):
    if shutil.which("pdflatex") is None:
        pytest.skip("pdflatex is not installed")
    write_tables(tmp_path, {"hard": HARD_TABLE})
    command = ["pdflatex", "-draftmode", "-halt-on-error", "-interaction=nonstopmode", "tables.tex"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout
