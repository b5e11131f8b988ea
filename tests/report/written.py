"""Metrics files of jobs that were never run, rows of tables by their headings, and what pages hold."""

import csv
import json
from html.parser import HTMLParser
from importlib.resources import files

from PIL import Image

from texgs.report.metrics_files import read_known
from texgs.report.results import as_mapping
from texgs.report.table import SOURCES


def read(paths):
    """The records of metrics files."""
    return read_known(paths)[0]


def metrics(folder, stage, result, dataset="engine", tf=None, recipe="quick", name="", **facts):
    """Write the metrics file of a job; returns its path."""
    path = folder / (name or f"{len(list(folder.iterdir())):04}.json")
    record = {"stage": stage, "dataset": dataset, "tf": tf, "recipe": recipe, "field": "surfels"}
    record |= {"device": "CPU", "peak_memory_mib": 1024.0, "variant": "", "sweep": "none", "seed": 0}
    record |= {"seconds": 1.0, "versions": {"python": "3"}}
    told = {"result": type(result).__name__, "numbers": as_mapping(result)}
    path.write_text(json.dumps({**record, **facts, **told}))
    return path


def job(folder, stage, result, pictures=(), **facts):
    """Write the metrics file of a job in a folder of its own, with pictures; returns its path."""
    place = folder / f"{len(list(folder.iterdir())):04}-{stage}"
    place.mkdir()
    for name in pictures:
        Image.new("RGB", (8, 4), "red").save(place / name)
    words = {name: f"Words of {name}." for name in pictures}
    return metrics(place, stage, result, pictures=words, **facts)


def records(folder):
    """Return all jobs of a folder."""
    return read(folder.glob("*.json"))


def rows(table):
    """Return cells by the headings of their columns."""
    return table.frame[[column.title for column in table.columns]].to_dict("records")


def sources(table):
    """Return the metrics files of each row."""
    return table.frame[SOURCES].tolist()


def lines(name):
    """Return the lines of a file of the paper's numbers, numbers as such."""

    def number(text):
        try:
            return float(text)
        except ValueError:
            return text

    text = files("texgs.report").joinpath("paper", f"{name}.csv").read_text().splitlines()
    rows = csv.DictReader(line for line in text if not line.startswith("#"))
    return [{key: number(value) for key, value in row.items()} for row in rows]


class Page(HTMLParser):
    """What a browser would find: tags with their attributes, and the text in each; all tags are closed."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.texts, self.open = [], [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self.open += [] if tag in ("meta", "img", "br", "input") else [tag]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if data.strip() and self.open:
            self.texts.append((self.open[-1], data.strip()))

    def all(self, tag):
        """Return the attributes of all tags of a kind."""
        return [attributes for name, attributes in self.tags if name == tag]

    def values(self, key):
        """Return the values of an attribute."""
        return [attributes[key] for _, attributes in self.tags if key in attributes]

    def of(self, tag):
        """Return the texts in all tags of a kind."""
        return [text for name, text in self.texts if name == tag]
