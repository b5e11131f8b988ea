"""Download files: pretrained weights by their names, which are listed, or any file by its address."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add which weights."""
    parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help="weights to download, where they are not here, or OWNER/NAME@REVISION (none: only list them)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Download what is named; then list all with their sizes and places."""
    from texgs.models.catalogue import CATALOGUE, entry_of
    from texgs.models.weights import find, locate, title_of

    for name in arguments.names:
        locate(name)
    for name in dict.fromkeys((*CATALOGUE, *arguments.names)):
        entry = entry_of(name)
        place = find(name) or f"not here; {entry.source}"
        print(f"{title_of(name):24} {entry.megabytes:6.0f} MB  {place}")
    return 0


def add_download_arguments(parser: argparse.ArgumentParser) -> None:
    """Add where from, what, and where to."""
    parser.add_argument("url", help="http or https address")
    parser.add_argument("--sha256", required=True, help="checksum of the file, hexadecimal")
    parser.add_argument("--output", type=Path, required=True, metavar="FILE", help="where it goes")


def run_download(arguments: argparse.Namespace) -> int:
    """Download a file and compare it with its checksum."""
    from texgs.volume.download import download

    download(arguments.url, arguments.sha256, arguments.output)
    return 0
