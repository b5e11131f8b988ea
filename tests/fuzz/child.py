"""Damaged files, read one after the other in a process of limited memory that may die of them."""

import faulthandler
import json
import random
import resource
import sys
from collections.abc import Iterable
from pathlib import Path

from tests.fuzz.mutate import mutated
from tests.fuzz.readers import READERS, Reader
from texgs.core.errors import TexgsError

MEMORY = 1 << 30  # bytes beyond those of the libraries
SECONDS = 30.0  # for one file; the slowest takes a second


def run(name: str, seeds: Iterable[int], folder: Path) -> None:
    """Read a whole file, and then a damaged one for each seed.

    Writes `outcomes`, two lines of JSON for a seed: when it begins, and what came of it. The second is
    missing where the process dies; `hangs` says where it was when time was up.
    """
    sys.stdout = sys.stderr = (folder / "printed").open("w")
    used = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    resource.setrlimit(resource.RLIMIT_DATA, (used + MEMORY, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    reader, case = READERS[name], folder / "case"
    case.mkdir()
    path = reader.make(case)
    reader.read(path)
    victim = path if reader.victim is None else case / reader.victim
    whole = victim.read_bytes()
    with (folder / "outcomes").open("w") as outcomes, (folder / "hangs").open("w") as hangs:
        for seed in seeds:
            outcomes.write(json.dumps([seed]) + "\n")
            outcomes.flush()
            victim.write_bytes(damaged(reader, whole, seed))
            faulthandler.dump_traceback_later(SECONDS, exit=True, file=hangs)
            outcome = outcome_of(reader, path)
            faulthandler.cancel_dump_traceback_later()
            outcomes.write(json.dumps([seed, *outcome]) + "\n")


def damaged(reader: Reader, whole: bytes, seed: int) -> bytes:
    """The bytes of a whole file with the damage of a seed."""
    if reader.unpack is not None and reader.pack is not None:
        return reader.pack(mutated(reader.unpack(whole), random.Random(seed)))
    return mutated(whole, random.Random(seed))


def outcome_of(reader: Reader, path: Path) -> tuple[str, str]:
    """What came of one file: valid, refused, or the name of another error; and its message."""
    try:
        reader.read(path)
    except TexgsError as error:
        return "refused", str(error)
    except Exception as error:
        return type(error).__name__, str(error)[:300]
    return "valid", ""
