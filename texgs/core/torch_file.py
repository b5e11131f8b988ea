"""Files that torch.save has written, without running anything that they may hold."""

from __future__ import annotations

import pickle
import pickletools
import warnings
from pathlib import Path
from typing import Any
from zipfile import ZipFile, is_zipfile

import torch

LONGEST_WORD = 1000  # letters of a text in a pickle; torch's search for a cause takes the square of it
OLD_PICKLES = 5  # one after the other at the start of a file of torch before 1.6


def load_torch(path: Path) -> Any:
    """Return what torch.load makes of a file, on the CPU.

    Raises:
        ValueError: if it holds more than tensors, lists, tables, numbers and text; torch raises other errors
            over files that are damaged.
    """
    is_zip = is_zipfile(path)
    _check_words(path, is_zip)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of unusual pickles
            return torch.load(path, map_location="cpu", weights_only=True, mmap=is_zip)
    except pickle.UnpicklingError as error:
        raise ValueError("what torch cannot read without running code in it") from error


def _check_words(path: Path, is_zip: bool) -> None:
    """Refuse texts of a length that no name of a tensor has."""
    if is_zip:
        with ZipFile(path) as archive:
            for name in archive.namelist():
                if name.endswith("data.pkl"):
                    with archive.open(name) as file:
                        _check_pickle(file)
        return
    with path.open("rb") as file:
        for _ in range(OLD_PICKLES):
            _check_pickle(file)


def _check_pickle(file: Any) -> None:
    for _, argument, _ in pickletools.genops(file):
        if isinstance(argument, str | bytes) and len(argument) > LONGEST_WORD:
            raise ValueError(f"a text of {len(argument)} letters")
