"""List pretrained weights with where they are, and download those that are named."""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which weights."""
    parser.add_argument(
        "names",
        nargs="*",
        metavar="NAME",
        help="weights to download, where they are not here (none: only list them)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Download what is named; then list all with their sizes and places."""
    from texgs.models.catalogue import CATALOGUE
    from texgs.models.weights import find, locate

    for name in arguments.names:
        locate(name)
    for name, entry in CATALOGUE.items():
        place = find(name) or f"not here; {entry.source}"
        print(f"{name:24} {entry.megabytes:6.0f} MB  {place}")
    return 0
