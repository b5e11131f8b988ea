"""Damaged files, read one after the other in a process of limited memory that may die of them."""

import faulthandler
import json
import random
import resource
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path

from tests.fuzz.mutate import mutated
from tests.fuzz.readers import READERS, Reader
from texgs.core.errors import TexgsError

MEMORY = 1 << 30  # bytes beyond those of the libraries
SECONDS = 20.0  # for one file; the slowest takes a tenth of one


def run(name: str, seeds: Iterable[int], folder: Path) -> None:
    """Write `outcomes`, a line of JSON for each seed; the last line has none where the process died of it."""
    sys.stdout = sys.stderr = (folder / "printed").open("w")
    used = 4096 * int(Path("/proc/self/statm").read_text().split()[5])
    resource.setrlimit(resource.RLIMIT_DATA, (used + MEMORY, resource.RLIM_INFINITY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with (folder / "outcomes").open("w") as outcomes, (folder / "hangs").open("w") as hangs:
        for seed in seeds:
            outcomes.write(json.dumps([seed]) + "\n")
            outcomes.flush()
            faulthandler.dump_traceback_later(SECONDS, exit=True, file=hangs)
            outcome = read_damaged(READERS[name], seed, folder / "case")
            faulthandler.cancel_dump_traceback_later()
            outcomes.write(json.dumps([seed, *outcome]) + "\n")


def damaged(reader: Reader, seed: int, folder: Path) -> Path:
    """The file to open, with the damage of a seed."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    path = reader.make(folder)
    victim = path if reader.victim is None else folder / reader.victim
    data = victim.read_bytes()
    if reader.unpack is not None and reader.pack is not None:
        victim.write_bytes(reader.pack(mutated(reader.unpack(data), random.Random(seed))))
    else:
        victim.write_bytes(mutated(data, random.Random(seed)))
    return path


def read_damaged(reader: Reader, seed: int, folder: Path) -> tuple[str, str]:
    """What came of one file: valid, refused, or the name of another error; and its message."""
    path = damaged(reader, seed, folder)
    try:
        reader.read(path)
    except TexgsError as error:
        return "refused", str(error)
    except Exception as error:
        return type(error).__name__, str(error)[:300]
    return "valid", ""
