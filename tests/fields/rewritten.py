"""Valid files of fields with some of their contents changed."""

import json

from safetensors import safe_open
from safetensors.torch import load_file, save_file


def description_of(path, format):
    """The JSON in the header of a file."""
    with safe_open(path, framework="pt") as file:
        return json.loads(file.metadata()[format])


def rewritten(path, format, tensors=None, **description):
    """The file with some tensors and entries of its description changed; None removes one.

    A tensor may be a function of the one that is there.
    """
    whole, header = load_file(path), {**description_of(path, format), **description}
    changed = {name: x(whole[name]) if callable(x) else x for name, x in (tensors or {}).items()}
    kept = {name: x.contiguous() for name, x in {**whole, **changed}.items() if x is not None}
    header = {name: value for name, value in header.items() if value is not None}
    save_file(kept, path, {format: json.dumps(header)})
    return path
