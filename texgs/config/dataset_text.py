"""The text of a data set's file, and the same text with another basic transfer function."""

import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from textwrap import indent
from typing import Any

import yaml

from texgs.config.compose import compose
from texgs.config.dataset import Dataset
from texgs.core.errors import ConfigError
from texgs.core.io import write_bytes
from texgs.volume.basic_tfs import BasicTF


def with_basic_tf(text: str, name: str, points: BasicTF, framed_by: list[str]) -> str:
    """Return the text of a data set with another basic TF, and the key `framed_by` if asked for."""
    text = text if text.endswith("\n") else f"{text}\n"
    entries = {key.value: (key, value) for key, value in yaml.compose(text, yaml.SafeLoader).value}
    key, value = entries.get("basic_tfs", (None, None))
    if not key or not isinstance(value, yaml.MappingNode) or value.flow_style or not value.value:
        raise ConfigError(
            "basic_tfs: expected a line for the name of each and lines below for its points, got other YAML "
            "or none in this file; write them so"
        )
    more = indent(as_yaml({name: plain_tf(points)}), " " * value.start_mark.column)
    more += as_yaml({"framed_by": framed_by}) if framed_by else ""
    start = key.start_mark.index
    block = re.findall(r"[^\n]*\n(?:(?:[#\r][^\n]*\n|\n)*[ \t][^\n]*\n)*", text[start:])[0]
    end = text.index("\n", start + len(block.rstrip())) + 1
    return text[:end] + (more.replace("\n", "\r\n") if "\r\n" in text else more) + text[end:]


def plain_tf(points: BasicTF) -> dict[str, Any]:
    """Return a basic TF as plain values, with the channel and labels that it names."""
    keys = ("channel", "label", "within", "opacity", "color")
    return {key: value for key in keys if (value := getattr(points, key)) is not None}


def as_yaml(values: Mapping[str, Any]) -> str:
    """Return YAML with each list on one line."""

    class Dumper(yaml.SafeDumper):
        """Lists on one line each."""

    Dumper.add_representer(
        list, lambda dumper, items: dumper.represent_sequence("tag:yaml.org,2002:seq", items, flow_style=True)
    )
    return str(yaml.dump(values, Dumper=Dumper, sort_keys=False, allow_unicode=True, width=10**6))


def require_read(text: str, dataset: Dataset) -> None:
    """Require that a text reads back as the data set it was written for."""
    name = dataset.name
    with tempfile.TemporaryDirectory() as folder:
        write_bytes(Path(folder, "dataset", f"{name}.yaml"), text.encode())
        read = compose((f"dataset={name}",), first=Path(folder)).dataset
    if read != dataset:
        raise ConfigError(
            f"{name}: expected to read {dataset} from the new file, got {read}; nothing was written"
        )
