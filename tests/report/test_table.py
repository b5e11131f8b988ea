import csv
import io
from pathlib import Path

from texgs.report.table import SOURCES, UNLIKE, Column, Table

TABLE = Table(
    "A caption.",
    (Column("name"), Column("dB", 2)),
    [{"name": "five_jets", "dB": 36.834, SOURCES: [Path("a/metrics.json")]}, {"name": "wood | stone"}],
)


def test_csv_keeps_all_digits_and_leaves_gaps():
    assert list(csv.reader(io.StringIO(TABLE.csv()))) == [
        ["name", "dB", "metrics files"],
        ["five_jets", "36.834", "a/metrics.json"],
        ["wood | stone", "", ""],
    ]
    unlike = Table("", TABLE.columns, [{"name": "a", "dB": UNLIKE}])
    assert unlike.csv().splitlines()[1] == "a,,", "columns of numbers stay such"


def test_markdown_says_what_was_not_measured():
    assert "| five_jets | 36.83 |" in TABLE.markdown()
    assert r"| wood \| stone | not measured |" in TABLE.markdown(), "a bar would begin a cell"
    assert Column("primitives", 0).text(1234567) == "1,234,567"
    assert TABLE.markdown().endswith("\n\nA caption.\n")


def test_a_row_is_one_line():
    broken = Table("two\nlines", TABLE.columns, [{"name": "a\nb", "dB": 1.0}], "Heading")
    assert broken.markdown().splitlines() == [
        "## Heading",
        "",
        "| name | dB |",
        "| --- | ---: |",
        "| a b | 1.00 |",
        "",
        "two lines",
    ]


def test_rows_keep_their_files_in_whatever_order_they_come():
    frame = TABLE.frame.iloc[::-1]
    table = Table("", TABLE.columns, frame)
    assert table.frame["metrics files"][1] == [Path("a/metrics.json")]
    assert table.frame["name"][0] == "wood | stone"
