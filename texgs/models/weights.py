"""Where the weights of a pretrained model are: a local folder, the hubs' caches, or else a download."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path

from texgs.core.cache import cache_folder, weights_folder
from texgs.core.checksum import Checksums, combined, sha256
from texgs.core.errors import ArgumentError, MissingDataError, first_line
from texgs.models.catalogue import CATALOGUE, File, Single, Snapshot


def locate(name: str) -> Path:
    """Path of the weights of a model: of a file, or of a folder in the layout of the Hugging Face hub.

    Looked for in the weights folder (TEXGS_WEIGHTS), in the caches of the hubs, and then downloaded with
    a line that says so and a progress bar, at a pinned revision or with a known checksum, into the cache.

    Args:
        name: of the catalogue, such as "vgg16" or "clip-vit-base-patch32".

    Raises:
        ArgumentError: if the name is unknown, or a file is not what its checksum says.
        MissingDataError: if the weights are nowhere and cannot be downloaded.
    """
    entry = _entry(name)
    path = _local(name, entry)
    if path is not None:
        return path
    return _download_file(name, entry) if isinstance(entry, Single) else _download_snapshot(name, entry)


def find(name: str) -> Path | None:
    """Path of the weights of a model on this machine; None where `locate` would have to download them.

    Raises:
        ArgumentError: if the name is unknown, or a file is not what its checksum says.
    """
    return _local(name, _entry(name))


def available(name: str) -> bool:
    """Whether the weights of a model are on this machine; see `find`."""
    return find(name) is not None


def checksum(name: str, checksums: Checksums) -> str | None:
    """Checksum of the weights that `locate` finds on this machine; None where there are none.

    Args:
        name: of the catalogue.
        checksums: what is known of files.

    Raises:
        ArgumentError: if the name is unknown, or a file is not what its checksum says.
    """
    entry, path = _entry(name), find(name)
    if path is None:
        return None
    if isinstance(entry, Single):
        return checksums.of(path)
    names = [next(each for each in names if (path / each).is_file()) for names in entry.needs]
    return combined((each, checksums.of(path / each)) for each in names)


def _entry(name: str) -> Single | Snapshot:
    if name not in CATALOGUE:
        raise ArgumentError(f"weights: expected one of {', '.join(CATALOGUE)}, got {name!r}")
    return CATALOGUE[name]


def _local(name: str, entry: Single | Snapshot) -> Path | None:
    if isinstance(entry, Snapshot):
        folders = (weights_folder() / name, _hub_folder(entry))
        return next((folder for folder in folders if _is_complete(folder, entry)), None)
    for file in entry.files:
        for folder in _file_folders():
            if (path := folder / file.name).is_file():
                _verify(name, file, path)
                return path
    return None


def _file_folders() -> Iterator[Path]:
    """Folders that files of weights may be in."""
    yield weights_folder()
    yield cache_folder() / "weights"
    home = os.environ.get("TORCH_HOME")
    yield (Path(home).expanduser() if home else Path.home() / ".cache" / "torch") / "hub" / "checkpoints"


def _hub_folder(entry: Snapshot) -> Path:
    """The folder of a snapshot in the cache of the Hugging Face hub, whether it is there or not."""
    home = Path(os.environ.get("HF_HOME") or Path.home() / ".cache" / "huggingface").expanduser()
    cache = Path(os.environ.get("HF_HUB_CACHE") or home / "hub").expanduser()
    return cache / f"models--{entry.repository.replace('/', '--')}" / "snapshots" / entry.revision


def _is_complete(folder: Path, entry: Snapshot) -> bool:
    return all(any((folder / name).is_file() for name in names) for names in entry.needs)


def _verify(name: str, file: File, path: Path) -> None:
    status = path.stat()
    checksum = _sha256(path, status.st_size, status.st_mtime_ns)
    if checksum != file.sha256:
        raise ArgumentError(
            f"{path}: expected the weights of {name} with checksum {file.sha256[:12]}, got {checksum[:12]}; "
            "the file is damaged or another one: remove it, and copy or download it again"
        )


@lru_cache
def _sha256(path: Path, size: int, time: int) -> str:
    """Checksum of a file, computed once for each size and time of it."""
    del size, time
    return sha256(path)


def _download_file(name: str, entry: Single) -> Path:
    file = next((file for file in entry.files if file.url is not None), None)
    if file is None:
        raise _missing(name, entry, [file.name for file in entry.files], entry.files[0].megabytes)
    import pooch

    pooch.get_logger().setLevel("WARNING")
    _announce(name, entry)
    folder = cache_folder() / "weights"
    try:
        downloaded = pooch.retrieve(file.url, f"sha256:{file.sha256}", file.name, folder, progressbar=True)
        return Path(downloaded)
    except (OSError, ValueError) as error:  # ValueError: of another checksum; nothing is kept then
        names = [file.name for file in entry.files]
        raise _missing(name, entry, names, file.megabytes, error) from error


def _download_snapshot(name: str, entry: Snapshot) -> Path:
    try:
        from huggingface_hub import snapshot_download
    except ImportError as error:
        raise _missing(name, entry, [name], entry.megabytes, error) from error
    _announce(name, entry)
    try:
        return Path(
            snapshot_download(entry.repository, revision=entry.revision, allow_patterns=list(entry.patterns))
        )
    except (OSError, ValueError, RuntimeError) as error:  # the hub's own errors are of these kinds
        raise _missing(name, entry, [name], entry.megabytes, error) from error


def _announce(name: str, entry: Single | Snapshot) -> None:
    """Say what the progress bar that follows is about."""
    print(f"{name}: downloading its weights ({entry.megabytes:g} MB) from {entry.source}", file=sys.stderr)


def _missing(
    name: str,
    entry: Single | Snapshot,
    targets: Sequence[str],
    megabytes: float,
    error: Exception | None = None,
) -> MissingDataError:
    reason = "" if error is None else f", and a download failed ({first_line(error)})"
    kind = "folder" if isinstance(entry, Snapshot) else "file"
    return MissingDataError(
        f"{name}: its weights ({megabytes:g} MB) are not on this machine{reason}; get them from "
        f"{entry.source} and put the {kind} "
        f"{' or '.join(targets)} into {weights_folder()}, or set TEXGS_WEIGHTS"
    )
