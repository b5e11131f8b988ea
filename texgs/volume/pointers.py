"""What stands in place of a file: a pointer of Git LFS, a page of HTML, one packed under another name."""

from collections.abc import Container
from pathlib import Path
from zipfile import ZipFile, is_zipfile

from texgs.core.errors import ArgumentError
from texgs.core.io import reading_as

LFS, GZIP, PAGES = b"version https://git-lfs", b"\x1f\x8b", (b"<!doctype html", b"<html")
OF_ZARR = (".zarray", ".zgroup", ".zattrs", "zarr.json")  # names in a zip of Zarr


def require_itself(path: Path) -> bytes:
    """Refuse what is known to stand in place of a file, and return how the file begins."""
    with path.open("rb") as file:
        start = file.read(64)
    if start.startswith(LFS):
        raise ArgumentError("expected a file, got a pointer of Git LFS in its place; run git lfs pull")
    if start.lstrip().lower().startswith(PAGES):
        raise ArgumentError("expected a file, got a page of HTML in its place; download it again, logged in")
    return start


def require_packing(path: Path, suffixes: Container[str]) -> None:
    """Require gzip where the suffix says so, and only there, of formats that have suffixes for both."""
    start, suffix = require_itself(path), path.suffix.lower()
    is_packed = start.startswith(GZIP)
    if suffix == ".gz" and start and not is_packed and Path(path.stem).suffix.lower() + suffix in suffixes:
        raise ArgumentError(f"expected gzip, got another file; if it is whole, rename it to {path.stem}")
    if is_packed and suffix + ".gz" in suffixes:
        raise ArgumentError(f"expected a file that is not packed, got gzip; rename it to {path.name}.gz")
    if suffix == ".zip" and is_zipfile(path):
        with reading_as("a folder or zip of Zarr"), ZipFile(path) as archive:
            names = archive.namelist()
        if not any(name.endswith(OF_ZARR) for name in names):
            raise ArgumentError(f"expected a zip of Zarr, got one of {', '.join(names[:3])} ...; unpack it")
