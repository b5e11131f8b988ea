"""Metrics files of jobs that were never run, and rows of tables by their headings."""

import csv
import json
from importlib.resources import files

from texgs.report.metrics_files import read
from texgs.report.results import plain
from texgs.report.table import SOURCES


def metrics(folder, stage, result, dataset="engine", tf=None, recipe="quick", **facts):
    """Write the metrics file of a job; returns its path."""
    path = folder / f"{len(list(folder.iterdir())):04}.json"
    record = {"stage": stage, "dataset": dataset, "tf": tf, "recipe": recipe, "field": "surfels"}
    record |= {"device": "CPU", "peak_memory_mib": 1024.0, "variant": "", "sweep": "none", "seed": 0}
    record |= {"seconds": 1.0, "versions": {"python": "3"}}
    told = {"result": type(result).__name__, "numbers": plain(result)}
    path.write_text(json.dumps({**record, **facts, **told}))
    return path


def records(folder):
    """All jobs of a folder."""
    return read(folder.glob("*.json"))


def rows(table):
    """Cells by the headings of their columns."""
    return table.frame[[column.title for column in table.columns]].to_dict("records")


def sources(table):
    """The metrics files of each row."""
    return table.frame[SOURCES].tolist()


def lines(name):
    """The lines of a file of the paper's numbers, numbers as such."""
    text = files("texgs.report").joinpath("paper", f"{name}.csv").read_text().splitlines()
    return [
        {key: number(value) for key, value in line.items()}
        for line in csv.DictReader(line for line in text if not line.startswith("#"))
    ]


def number(text):
    try:
        return float(text)
    except ValueError:
        return text
