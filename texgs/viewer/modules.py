"""The JavaScript modules of texgs/viewer/web as one script, for pages that have no server to import from."""

from __future__ import annotations

import re
from importlib.resources import files

IMPORT = re.compile(r'^import \{[^}]*\} from "\./([\w-]+\.js)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:async )?(?:function|class|const) )", re.MULTILINE)


def web_file(name: str) -> str:
    """The text of a file of texgs/viewer/web."""
    return files("texgs.viewer").joinpath("web", name).read_text(encoding="utf-8")


def joined_modules(*entries: str) -> str:
    """Modules and all that they import, each once and behind what it imports.

    Modules import by name from the same folder, so that leaving out the words `import` and `export` makes
    them one module. For this their names on the top level differ, which a test checks.

    Args:
        entries: names of files.
    """
    texts: dict[str, str] = {}

    def add(name: str) -> None:
        if name in texts:
            return
        text = web_file(name)
        for imported in IMPORT.findall(text):
            add(imported)
        texts[name] = EXPORT.sub("", IMPORT.sub("", text)).strip()

    for entry in entries:
        add(entry)
    return "\n\n".join(texts.values()) + "\n"
