"""The folder of a job's result: made beside its place, swapped in when it is complete, checked by checksums.

For a job whose folder is `shading` there are:

- `shading`, the last complete result;
- `shading/.job.json`, the identity of the job that made it;
- `shading/.files.json`, its files with their checksums, written when it is complete;
- `.shading.work`, what the running job has so far, or an interrupted one;
- `.shading.lock`, held by the process that works there.
"""

import json
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from texgs.core.cache import Checksums, combined_checksum, sha256
from texgs.core.errors import ArgumentError
from texgs.core.io import read_json, remove_scratch, write_json
from texgs.core.names import METRICS
from texgs.volume.input_files import checksum_of_input

STAMP = ".job.json"
FILES = ".files.json"
TIMES = "times.json"  # times of single views; like METRICS it differs from one run to the next


@contextmanager
def alone(output: Path) -> Iterator[None]:
    """Keep other processes out of a job's folder; where one works there, say so and wait for it to end."""
    lock = FileLock(output.parent / f".{output.name}.lock")
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        try:
            lock.acquire(blocking=False)
        except Timeout:
            print(f"{output}: another job works there; waiting for it to end", file=sys.stderr)
            lock.acquire()
    except OSError as error:
        raise ArgumentError(
            f"{output}: cannot write there ({error.strerror}); choose other results"
        ) from error
    try:
        yield
    finally:
        lock.release()


def forget(output: Path) -> None:
    """Remove what a job has left that cannot succeed, and the folder around it if that is empty."""
    shutil.rmtree(work_folder(output), ignore_errors=True)
    with suppress(OSError):  # where nothing may be removed, it stays
        output.with_name(f".{output.name}.lock").unlink(missing_ok=True)
        output.parent.rmdir()


def run_alone(results: str) -> FileLock:
    """Hold the results of a workflow as long as the process lives, which keeps the lock."""
    lock = FileLock(Path(results, ".run.lock"))
    try:
        lock.acquire(blocking=False)
    except Timeout as error:
        raise ArgumentError(
            f"{results}: another run works there; wait for it to end, or choose other results=FOLDER"
        ) from error
    return lock


def work_folder(output: Path) -> Path:
    """Return where a job works before its result is complete: beside it, so that relative paths hold."""
    return output.with_name(f".{output.name}.work")


def claim(output: Path, identity: dict[str, Any], *, is_fresh: bool = False) -> Path:
    """Return the folder for a job to work in: with what an interrupted run of the same job left there.

    A damaged result of the same job is a start, too: its good files are kept. A fresh start is from nothing;
    then the result stays in any case until it is replaced.
    """
    require_own(output)
    work = work_folder(output)
    if is_fresh or stamp_of(work) != identity:
        shutil.rmtree(work, ignore_errors=True)
        if not is_fresh and stamp_of(output) == identity:
            lost = damaged_files(output, None)
            output.rename(work)  # first: a folder without its records is taken for somebody else's
            for name in (*lost, METRICS, FILES):
                (work / name).unlink(missing_ok=True)
    write_json(work / STAMP, identity)
    remove_scratch(work)
    return work


def publish(output: Path) -> None:
    """Put what a job has made, with the checksums of all its files, in place of the result before it."""
    require_own(output)  # the job took its time, in which somebody may have put a file there
    work, old = work_folder(output), output.with_name(f".{output.name}.old")
    names = sorted(path.relative_to(work).as_posix() for path in work.rglob("*") if path.is_file())
    write_json(work / FILES, {name: sha256(work / name) for name in names if name not in (STAMP, FILES)})
    if output.exists():
        output.rename(old)
    work.rename(output)
    shutil.rmtree(old, ignore_errors=True)


def recover(output: Path) -> None:
    """Finish what a process that was killed while it swapped two results had begun."""
    work, old = work_folder(output), output.with_name(f".{output.name}.old")
    if output.exists() and not output.is_dir():
        return  # somebody else's
    if not output.exists() or not any(output.iterdir()):
        complete = (folder for folder in (work, old) if (folder / FILES).exists())
        if (folder := next(complete, None)) is not None:
            folder.rename(output)
    shutil.rmtree(old, ignore_errors=True)


def stamp_of(folder: Path) -> Any:
    """Return the identity of the job that a folder is of; None where there is none that can be read."""
    try:
        return read_json(folder / STAMP)
    except ArgumentError:
        return None


def file_checksums(folder: Path) -> dict[str, str]:
    """Return checksums of the files of a complete result, by their names; none where they cannot be read."""
    try:
        known = read_json(folder / FILES)
    except ArgumentError:
        return {}
    return known if isinstance(known, dict) else {}


def damaged_files(output: Path, checksums: Checksums | None) -> list[str]:
    """Return the files of a complete result that are missing or not what they were.

    What is not known of files, without checksums anything, is read.
    """
    if not (output / FILES).exists():
        return []
    if not (known := file_checksums(output)):
        return [FILES]
    checksum = sha256 if checksums is None else checksums.of
    return [
        name
        for name, expected in known.items()
        if not (output / name).is_file() or checksum(output / name) != expected
    ]


def is_complete(output: Path, checksums: Checksums) -> bool:
    """Return whether a result is there with all its files, as they were made."""
    return (output / FILES).exists() and (output / METRICS).exists() and not damaged_files(output, checksums)


def require_own(output: Path) -> None:
    """Require a folder that is of texgs alone, so that nothing else is lost when it is replaced."""
    if output.is_symlink() or (output.exists() and not output.is_dir()):
        raise ArgumentError(f"{output}: expected a folder, got a link or a file; move it away")
    if not output.exists() or not any(output.iterdir()):
        return
    if not (output / STAMP).exists():
        raise ArgumentError(
            f"{output}: expected an empty folder or one of texgs, got other files; move them away"
        )
    if not (known := file_checksums(output)):
        raise ArgumentError(
            f"{output / FILES}: cannot be read, so nothing tells which files there are yours; move those out "
            f"of {output}, then remove it"
        )
    own = {*known, STAMP, FILES}
    there = (path.relative_to(output) for path in output.rglob("*") if not path.is_dir())
    if foreign := sorted(path.as_posix() for path in there if not own & {path.as_posix(), path.parts[0]}):
        raise ArgumentError(
            f"{output}: the job is to be done again, but the folder also holds {', '.join(foreign[:3])}; "
            "move what is yours away"
        )


def fingerprint(path: Path, checksums: Checksums) -> str:
    """Return the checksum of an input: of the result that it belongs to, with the identity of its job.

    A file from elsewhere counts with its contents, see `checksum_of_input`.
    """
    folder = path.parent
    made_files = file_checksums(folder)
    is_foreign = path.exists() and path.name not in made_files
    if (folder / FILES).exists() and not is_foreign:
        made = [(name, sha) for name, sha in made_files.items() if name not in (METRICS, TIMES)]
        return combined_checksum([*made, (STAMP, json.dumps(stamp_of(folder), sort_keys=True))])
    return checksum_of_input(path, checksums)


def require_intact(path: Path) -> None:
    """Require of an input that the result it belongs to is as it was made; reads all of its files."""
    folder = path.parent
    if not (lost := damaged_files(folder, None)):
        return
    checksums = Checksums.load()  # whoever looks next shall look at the file itself
    for name in lost:
        checksums.forget(folder / name)
    checksums.save()
    maker = (stamp_of(folder) or {}).get("stage", "the stage before")
    raise ArgumentError(
        f"{folder / lost[0]}: missing or damaged since {maker} made it; "
        "run the same command again to repair it"
    )
