"""The JavaScript modules of texgs/viewer/web as one script, for pages that have no server to import from."""

from __future__ import annotations

import re
from importlib.resources import files

IMPORT = re.compile(r'^import (\{[^}]*\}) from "\./([\w-]+\.js)";$', re.MULTILINE)
EXPORT = re.compile(r"^export ((?:async )?(?:function|class|const) (\w+))", re.MULTILINE)


def web_file(name: str) -> str:
    """The text of a file of texgs/viewer/web."""
    return files("texgs.viewer").joinpath("web", name).read_text(encoding="utf-8")


def joined_modules(*entries: str) -> str:
    """Modules and all that they import, each once and behind what it imports.

    Each becomes a function with its own names, which returns what the module exports into `modules`. That
    does for modules that import by name, from the same folder, and whose exports are declarations.

    Args:
        entries: names of files.
    """
    texts: dict[str, str] = {}

    def add(name: str) -> None:
        if name in texts:
            return
        text = web_file(name)
        for _, imported in IMPORT.findall(text):
            add(imported)
        exports = ", ".join(exported for _, exported in EXPORT.findall(text))
        body = EXPORT.sub(r"\1", IMPORT.sub(r'const \1 = modules["\2"];', text)).strip()
        texts[name] = f'modules["{name}"] = (() => {{\n{body}\nreturn {{ {exports} }};\n}})();'

    for entry in entries:
        add(entry)
    return "\n\n".join(["const modules = {};", *texts.values()]) + "\n"
