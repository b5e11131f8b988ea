"""LaTeX that compiles: by pdflatex where there is one, and by the rules of its grammar everywhere."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from texgs.report.latex import escape
from texgs.report.table import SOURCES, Column, Table, write_tables

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
    assert [rule for rule in ("toprule", "midrule", "bottomrule") if rf"\{rule}" in text] == [
        "toprule",
        "midrule",
        "bottomrule",
    ]


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
