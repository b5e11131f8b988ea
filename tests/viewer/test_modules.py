"""The modules of the front end as one script."""

import re

from texgs.viewer.modules import IMPORT, joined_modules, web_file

TOP = re.compile(r"^(?:async )?(?:function|class|const|let) (?:\[?([\w, ]+)\]?)", re.MULTILINE)


def test_modules_come_once_and_behind_what_they_import():
    text = joined_modules("webgl.js", "sort.js")
    assert text.count("class DepthOrder") == 1
    assert text.index("const WIDTH") < text.index("const SURFEL_VERTEX") < text.index("class WebglRenderer")


def test_nothing_is_imported_or_exported_any_more():
    text = joined_modules("standalone.js")
    assert not re.search(r"^\s*(import|export)\b", text, re.MULTILINE)
    assert IMPORT.findall(web_file("shaders.js")) == ["surfels.js"]


def test_names_on_the_top_level_differ():
    names = [name for group in TOP.findall(joined_modules("standalone.js")) for name in group.split(", ")]
    assert len(names) > 20
    assert len(names) == len(set(names))
