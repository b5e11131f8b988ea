"""Names and numbers from files or a user, before names are shown or become a part of a path."""

import difflib
import re
from collections.abc import Iterable
from fractions import Fraction
from itertools import count
from math import isfinite
from numbers import Integral
from pathlib import Path
from typing import SupportsFloat
from unicodedata import category

from texgs.core.errors import ArgumentError

SCENES = (".yaml", ".yml")  # suffixes of scene files
EXPORTS = {  # endings of what `texgs export` writes, by its kind
    **dict.fromkeys(("3dgs", "2dgs", "release", "points", "mesh"), (".ply",)),
    **{"compact": (".texgs",), "html": (".html",)},
    **{"usd": (".usdc", ".usda"), "gltf": (".glb",), "spz": (".spz",), "vtp": (".vtp",)},
    "textured": (".glb", ".obj"),
}
SCENE, METRICS, PAGE = "scene.yaml", "metrics.json", "scene.html"  # as jobs write them
STYLE = "style"  # how the names of pictures begin that looks follow
POINTS = "points3d.ply"  # where fits start, in a folder of views
SLICES = (".tif", ".tiff")  # suffixes of the files in a folder of slices
MAX_NUMBER = 10**300  # there are whole numbers that no float can hold
MAX_NAME_LETTERS = 100  # letters of a name
MAX_PATH_LETTERS = 1000  # letters of a path in a file
MAX_FILE_BYTES = 250  # bytes of a file's name; file systems take 255, and we put a few before it
RESERVED_LETTERS = "/.="  # not in names of segments: they address MODEL/SEGMENT.KEY=VALUE
SPACES = "Zs"  # Unicode's category of all spaces; folders of macOS have some that do not break
SEPARATORS = frozenset("/\\")  # of folders, on one system or another


def label(where: str, name: object) -> str:
    """Return a name of something in a scene or a data set: short, and of letters that a terminal can show."""
    text = str(name)  # YAML reads some names as numbers
    if not text.strip() or len(text) > MAX_NAME_LETTERS or not text.isprintable():
        raise ArgumentError(
            f"{where}: expected a name of 1 to {MAX_NAME_LETTERS} printable letters, "
            f"got {text[: MAX_NAME_LETTERS + 1]!r}"
        )
    return text


def mask_name(label: str) -> str:
    """Return the name that the mask of a label has among the channels of a prepared volume."""
    return f"label {label}"


def require_name(name: str | None, where: str) -> None:
    """Require a name that a segment can have."""
    if not name or any(mark in label(where, name) for mark in RESERVED_LETTERS):
        raise ArgumentError(f"{where}: expected a name without {' '.join(RESERVED_LETTERS)}, got {name}")


def file_name(where: str, name: str) -> str:
    """Return a name, with its ending, that is one file or folder, and no way to another folder.

    Every name that is written goes through here. Separators, control characters, a dot at the start, and a
    name that is empty or too long are refused.
    """
    is_plain = name.isprintable() and not SEPARATORS & set(name) and not name.startswith(".")
    if not is_plain or not name or len(name.encode()) > MAX_FILE_BYTES:
        raise ArgumentError(
            f"{where}: expected a name that a file can have, without / and \\, control characters and a dot "
            f"at its start, of at most {MAX_FILE_BYTES} bytes; got {name[: MAX_NAME_LETTERS + 1]!r}"
        )
    return name


def style_file(part: str = "") -> str:
    """Return the name of the picture that a look follows; of one of its parts, where each has its own."""
    return f"{STYLE}-{part.replace('/', '-')}.png" if part else f"{STYLE}.png"


def part_file(where: str, *names: str) -> str:
    """Return the name of the safetensors file of a part of a scene, whose names may have slashes."""
    return file_name(where, f"{'-'.join(names)}.safetensors".replace("/", "-"))


def part_files(where: str, parts: Iterable[str]) -> dict[str, str]:
    """Return the file of each part, with a number where another part has one of that name."""
    files: dict[str, str] = {}
    for part in parts:
        names = (part_file(where, part, *([str(n)] if n > 1 else [])) for n in count(1))
        files[part] = next(name for name in names if name not in files.values())
    return files


def new_part_file(where: str, folder: Path, *names: str) -> Path:
    """Return the file of a part, with a number where there is one already: saved scenes may name that."""
    files = (folder / part_file(where, *names, *([str(n)] if n > 1 else [])) for n in count(1))
    return next(file for file in files if not file.exists())


def named_file(where: str, folder: Path, path: object, kind: str = "a file") -> Path:
    """Return the file that another file in a folder names, there or elsewhere; it is only read."""
    is_path = isinstance(path, str) and 0 < len(path) <= MAX_PATH_LETTERS
    if not is_path or not all(each.isprintable() or category(each) == SPACES for each in str(path)):
        raise ArgumentError(f"{where}: expected the path of {kind}, got {path!r:.100}")
    return folder / str(path)


def require_scene(path: Path) -> None:
    """Require a scene, a folder with one or a model file that is there."""
    if not path.exists():
        raise ArgumentError(
            f"{path}: no such scene, folder or model; check its name, or let texgs compose write a scene"
        )


def close(word: object, known: Iterable[str]) -> str:
    """Return a hint at the known word that is most like the given one, or at both, whether capital or not."""
    small, names = str(word).lower(), {each.lower(): each for each in known}
    similar = difflib.get_close_matches(small, names, n=2)
    shares = [difflib.SequenceMatcher(None, each, small).ratio() for each in similar]
    alike = [names[each] for each, share in zip(similar, shares, strict=True) if share == shares[0]]
    return f", did you mean {' or '.join(sorted(alike))}?" if alike else ""


def natural_order(path: Path, *, has_decimals: bool = False) -> list[tuple[str, Fraction]]:
    """Return the place of a file among others by the numbers in its path: slice9 comes before slice10.

    Where numbers may have decimals, 0.25 comes before 0.5.
    """
    number = r"\d+(?:\.\d+)?|" if has_decimals else r"\d*"
    return [(text, Fraction(digits or -1)) for text, digits in re.findall(rf"(\D*)({number})", str(path))]


def check_window(window: tuple[float, float] | None) -> None:
    """Require that the value in black, if there is one, is below that in white."""
    if window is not None and not window[0] < window[1]:
        raise ArgumentError(f"window: expected black below white, got {list(window)}")


def is_number(value: object) -> bool:
    """Return whether a value is a finite number; true and false are none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= MAX_NUMBER and isfinite(value)


def require_numbers(**values: object) -> None:
    """Require numbers, also those of NumPy, by the names of arguments; text is none."""
    for name, value in values.items():
        if not isinstance(value, SupportsFloat):
            raise ArgumentError(f"{name}: expected a number, got {value!r:.100}")


def check_count(name: str, value: object, least: int = 1) -> None:
    """Require a whole number, by the name of an argument."""
    if not isinstance(value, Integral) or value < least:
        raise ArgumentError(f"{name}: expected a whole number from {least} on, got {value!r:.100}")
