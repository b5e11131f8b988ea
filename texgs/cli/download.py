"""Download a file and compare it with its checksum, unless it is there and whole."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where from, what, and where to."""
    parser.add_argument("url", help="http or https address")
    parser.add_argument("--sha256", required=True, help="checksum of the file, hexadecimal")
    parser.add_argument("--output", type=Path, required=True, metavar="FILE", help="where it goes")


def run(arguments: argparse.Namespace) -> int:
    """Download it."""
    from texgs.volume.download import download

    download(arguments.url, arguments.sha256, arguments.output)
    return 0
