"""Valid files of fields with some of their contents changed."""

import json

from safetensors import safe_open
from safetensors.torch import load_file, save_file


def description_of(path, format):
    """The JSON in the header of a file."""
    with safe_open(path, framework="pt") as file:
        return json.loads(file.metadata()[format])


def rewritten(path, format, tensors=None, **description):
    """The file with some tensors (None removes one) and entries of its description (as well) changed."""
    header = {**description_of(path, format), **description}
    header = {name: value for name, value in header.items() if value is not None}
    kept = {
        name: x.contiguous() for name, x in {**load_file(path), **(tensors or {})}.items() if x is not None
    }
    save_file(kept, path, {format: json.dumps(header)})
    return path
