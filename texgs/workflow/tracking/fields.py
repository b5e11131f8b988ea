"""Names and values as MLflow takes them: flat, short, and of characters it allows."""

import json
import re
from collections.abc import Mapping

LONGEST_NAME = 250
LONGEST_PARAM = 6000
LONGEST_TAG = 8000


def flatten(values: Mapping[str, object], prefix: str = "") -> dict[str, str]:
    """Parameters of a nested mapping: keys joined by dots, strings as they are, lists and booleans as JSON.

    Values that MLflow has no room for are cut and end in an ellipsis.

    Example:
        >>> flatten({"fit": {"steps": 3, "rates": [0.1, 0.2]}})
        {'fit.steps': '3', 'fit.rates': '[0.1, 0.2]'}
    """
    flat: dict[str, str] = {}
    for key, value in values.items():
        if isinstance(value, Mapping) and value:
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[allowed_name(f"{prefix}{key}")] = cut(_text(value), LONGEST_PARAM)
    return flat


def allowed_name(text: str) -> str:
    """A name MLflow accepts: other characters become underscores, empty and dotted path parts are dropped."""
    allowed = re.sub(r"[^\w./: -]", "_", text)
    parts = [part for part in allowed.split("/") if part not in ("", ".", "..")]
    return "/".join(parts)[:LONGEST_NAME].rstrip("/") or "_"


def cut(text: str, longest: int) -> str:
    """The text itself, or its beginning and an ellipsis."""
    return text if len(text) <= longest else f"{text[: longest - 1]}…"


def _text(value: object) -> str:
    if value is None or isinstance(value, bool | list | tuple | Mapping):
        return json.dumps(value, default=str)
    return str(value)
