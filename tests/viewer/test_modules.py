"""The modules of the front end as one script."""

import re
from importlib.resources import files

import pytest

from texgs.viewer.standalone import EXPORT, IMPORT, joined_modules, web_file

PAGES = ("standalone.js", "main.js")


@pytest.mark.parametrize("page", PAGES)
def test_modules_come_once_and_behind_what_they_import_in_known_words(page):
    text = joined_modules(page)
    begun = re.findall(r'^modules\["([\w-]+\.js)"\] = ', text, re.MULTILINE)
    assert len(begun) == len(set(begun)) > 5
    assert begun[-1] == page
    for name in begun:
        imported = [other for _, other in IMPORT.findall(web_file(name))]
        assert all(begun.index(other) < begun.index(name) for other in imported)
    assert not re.search(r"^\s*(import|export)\b", text, re.MULTILINE)
    assert " as " not in "".join(names for names, _ in IMPORT.findall(web_file(page)))


def test_what_a_module_imports_is_exported():
    modules = sorted(path.name for path in (files("texgs.viewer") / "web").iterdir() if path.suffix == ".js")
    assert set(PAGES) < set(modules)
    for name in modules:
        for names, other in IMPORT.findall(web_file(name)):
            exported = {export for _, export in EXPORT.findall(web_file(other))}
            assert set(re.findall(r"\w+", names)) <= exported
