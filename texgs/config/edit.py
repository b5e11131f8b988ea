"""The schema of conf/edit: what all edits of a scene have, and a table of keys for each method."""

from dataclasses import make_dataclass
from typing import Any

from texgs.core.keys import key
from texgs.edit.keys import EditKeys
from texgs.edit.method import methods


def _with_methods() -> Any:
    """The keys of all edits, and a table of keys for each method."""
    tables = [
        (method.name, method.settings, key(method.settings, method.summary)) for method in methods().values()
    ]
    return make_dataclass(
        "Edit", tables, bases=(EditKeys,), frozen=True, namespace={"__doc__": EditKeys.__doc__}
    )


Edit = _with_methods()
