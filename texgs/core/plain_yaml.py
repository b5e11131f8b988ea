"""YAML that people write: plain values, numbers as everywhere else, and nothing that grows when read."""

import re
from typing import Any

import yaml

from texgs.core.errors import ArgumentError

MAX_DEPTH = 20  # tables and lists in one another
# YAML 1.1 takes 5e-1 and 1e3 for text, because they have no point or no sign.
NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+$")


class PlainLoader(yaml.SafeLoader):  # type: ignore[misc]
    """The safe loader without aliases: few of them can stand for more values than fit into memory."""

    depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Return a node of the text."""
        if self.check_event(yaml.AliasEvent):
            line = self.peek_event().start_mark.line + 1
            raise ArgumentError(f"expected values, got an alias (*name) in line {line}; write them out")
        if tag := getattr(self.peek_event(), "tag", None):
            line = self.peek_event().start_mark.line + 1
            raise ArgumentError(f"expected values, got the tag {tag} in line {line}; leave it out")
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise ArgumentError(f"expected at most {MAX_DEPTH} tables and lists in one another, got more")
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Return a table, whose keys stand there once each: PyYAML would take the last."""
        keys = [key.value for key, _ in node.value]
        for number, (key, _) in enumerate(node.value):
            if key.value in keys[:number]:
                line = key.start_mark.line + 1
                raise ArgumentError(
                    f"expected each key once, got {key.value} again in line {line}; rename it"
                )
        return dict(super().construct_mapping(node, deep))


PlainLoader.add_implicit_resolver("tag:yaml.org,2002:float", NUMBER, list("-+.0123456789"))


def parse_yaml(text: str) -> Any:
    """Return the values of a text.

    PyYAML raises a YAMLError or ValueError for characters that no text has and values such as 2001-99-99.
    """
    try:
        return yaml.load(text, PlainLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f" in line {mark.line + 1}" if mark else ""
        raise ArgumentError(
            f"expected YAML, got a mistake{line} ({error.problem or error.context}); correct it"
        ) from error
