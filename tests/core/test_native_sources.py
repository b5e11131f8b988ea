"""The digest of the native sources: what counts, and that libraries carry it."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from texgs.core import native_sources
from texgs.core.native_sources import native_digest

SOURCES = {
    "maths.h": "// The sum.\ninline float sum(float a, float b) { return a + b; }\n",
    "cuda/forward.cu": '/* two\nlines */ const char* text = "// no comment"; int quote = \'"\'; // one\n',
    "cuda/CMakeLists.txt": "add_library(x SHARED forward.cu) # a library\n",
}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "cuda").mkdir()
    for name, text in SOURCES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("name", "old", "new", "counts"),
    [
        ("maths.h", "// The sum.", "// The sum of two numbers: 'a' and b.", False),
        ("maths.h", " { return", "\n{\n    return", False),
        ("cuda/forward.cu", "/* two\nlines */", "", False),
        ("cuda/forward.cu", "// one", "// another", False),
        ("cuda/CMakeLists.txt", "# a library", "# nothing", False),
        ("maths.h", "a + b", "a - b", True),
        ("cuda/forward.cu", "// no comment", "// a comment", True),
        ("cuda/forward.cu", "quote", "mark", True),
        ("cuda/CMakeLists.txt", "SHARED", "STATIC", True),
    ],
)
def test_code_counts_and_comments_and_layout_do_not(folder, name, old, new, counts):
    before = native_digest(folder)
    assert old in SOURCES[name]
    (folder / name).write_text(SOURCES[name].replace(old, new))
    assert (native_digest(folder) != before) is counts


def test_a_new_file_and_another_name_count(folder):
    before = native_digest(folder)
    shutil.move(folder / "maths.h", folder / "math.h")
    renamed = native_digest(folder)
    (folder / "more.h").write_text("int x;")
    assert len({before, renamed, native_digest(folder)}) == 3


def test_the_build_gets_the_same_digest_without_texgs(folder):
    command = [sys.executable, "-I", str(Path(native_sources.__file__)), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == native_digest(folder)
