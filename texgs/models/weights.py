"""Find the weights of pretrained models: in a local folder, in the hubs' caches, or by download."""

import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

from texgs.core.cache import Checksums, cache_folder, combined_checksum, weights_folder
from texgs.core.errors import ArgumentError, MissingDataError, first_line
from texgs.core.io import read_json
from texgs.models.catalogue import File, Single, Snapshot, entry_of

VERIFIED_CHECKSUMS = Checksums()  # of files that this process has read
CONNECT_SECONDS = 20.0  # seconds to wait for a hub


def locate(name: str) -> Path:
    """Return the path of the weights of a model: a file, or a folder in the layout of the Hugging Face hub.

    The search covers the weights folder (TEXGS_WEIGHTS) and the caches of the hubs. Otherwise the weights are
    downloaded into the cache, with a message and a progress bar, at a pinned revision or checksum.
    """
    return find(name) or _download(name, entry_of(name))


def find(name: str) -> Path | None:
    """Return the path of the weights on this machine, or None if `locate` would download them."""
    entry = entry_of(name)
    if isinstance(entry, Snapshot):
        folders = (weights_folder() / name, *_hub_folders(entry))
        return next((folder for folder in folders if _is_complete(folder, entry)), None)
    for file in entry.files:
        for folder in _file_folders():
            if (path := folder / file.name).is_file():
                _verify(name, file, path)
                return path
    return None


def missing_advice(name: str) -> str:
    """Return why the weights of a model cannot be used here, and what to do; "" if they can."""
    if find(name) is None:
        how = f"`texgs weights {name}` downloads them or says how to get them"
        return f"the weights of {name} are not on this machine; {how}"
    entry = entry_of(name)
    packages = entry.packages if isinstance(entry, Snapshot) else ()
    if lacking := [package for package in packages if find_spec(package) is None]:
        return f"{lacking[0]}, which reads {name}, is not installed; pip install '.[models]' adds it"
    return ""


def title_of(name: str) -> str:
    """Return the name of weights, with the revision of a snapshot that is not the catalogue's."""
    entry = entry_of(name)
    if not isinstance(entry, Snapshot) or (path := find(name)) is None:
        return name
    if path.name in (name.rpartition("/")[2], entry.revision):
        return name
    return f"{name} (revision {path.name[:12]}, not {entry.revision[:12]})"


def checksum(name: str, checksums: Checksums) -> str | None:
    """Return the checksum of the weights that `find` returns, from known checksums, or None if unusable."""
    path = find(name)
    if path is None or missing_advice(name):
        return None
    entry = entry_of(name)
    if isinstance(entry, Single):
        return checksums.of(path)
    needs = entry.needs or pipeline_files(path)
    names = [next(each for each in names if (path / each).is_file()) for names in needs]
    return combined_checksum((each, checksums.of(path / each)) for each in names)


def _file_folders() -> Iterator[Path]:
    """Yield the folders to search for files of weights."""
    yield weights_folder()
    yield cache_folder() / "weights"
    home = os.environ.get("TORCH_HOME")
    yield (Path(home).expanduser() if home else Path.home() / ".cache" / "torch") / "hub" / "checkpoints"


def _hub_folders(entry: Snapshot) -> list[Path]:
    """Return the snapshot folders in the Hugging Face cache, the catalogue's revision first."""
    home = Path(os.environ.get("HF_HOME") or Path.home() / ".cache" / "huggingface").expanduser()
    cache = Path(os.environ.get("HF_HUB_CACHE") or home / "hub").expanduser()
    snapshots = cache / f"models--{entry.repository.replace('/', '--')}" / "snapshots"
    # A pipeline needs exactly its revision.
    return [snapshots / entry.revision, *(sorted(snapshots.glob("*")) if entry.needs else ())]


def pipeline_files(folder: Path) -> list[tuple[str, ...]]:
    """Return the files of a diffusers pipeline, each with alternative names; none without an index."""
    files: list[tuple[str, ...]] = [("model_index.json",)]
    with suppress(ArgumentError, LookupError, TypeError, AttributeError):
        index = read_json(folder / "model_index.json")
        for part in [name for name, kind in index.items() if isinstance(kind, list) and kind[0]]:
            settings = sorted(path.name for path in (folder / part).glob("*.json")) or ["config.json"]
            files += [(f"{part}/{name}",) for name in settings]
            if tables := [name for name in settings if name.endswith(".safetensors.index.json")]:
                table = read_json(folder / part / tables[0])["weight_map"]
                files += [(f"{part}/{name}",) for name in sorted(set(table.values()))]
            elif "config.json" in settings:  # a network
                files.append(tuple(f"{part}/{x}.safetensors" for x in ("diffusion_pytorch_model", "model")))
        return files
    return []


def _is_complete(folder: Path, entry: Snapshot) -> bool:
    """Return whether a folder has all required files of a snapshot."""
    needs = entry.needs or pipeline_files(folder)
    return bool(needs) and all(any((folder / name).is_file() for name in names) for names in needs)


def _verify(name: str, file: File, path: Path) -> None:
    """Require that a file has the catalogue's checksum."""
    checksum = VERIFIED_CHECKSUMS.of(path)
    if checksum != file.sha256:
        raise ArgumentError(
            f"{path}: expected the weights of {name} with checksum {file.sha256[:12]}, got {checksum[:12]}; "
            "the file is damaged or another one: remove it, and copy or download it again"
        )


def _download(name: str, entry: Single | Snapshot) -> Path:
    """Download weights after a line that says what the progress bar is about."""
    size = f"{entry.megabytes:g} MB" if entry.megabytes else "of unknown size"
    print(f"{name}: downloading its weights ({size}) from {entry.source}", file=sys.stderr)
    try:
        if isinstance(entry, Single):
            import pooch

            pooch.get_logger().setLevel("WARNING")
            file, folder = entry.file, cache_folder() / "weights"
            known = f"sha256:{file.sha256}"
            return Path(pooch.retrieve(entry.source, known, file.name, folder, progressbar=True))
        from huggingface_hub import HfApi, snapshot_download

        HfApi().model_info(
            entry.repository, revision=entry.revision, timeout=CONNECT_SECONDS
        )  # it tries only once
        patterns = list(entry.patterns)
        return Path(snapshot_download(entry.repository, revision=entry.revision, allow_patterns=patterns))
    except Exception as error:  # including errors of the client's HTTP library
        files = [file.name for file in entry.files] if isinstance(entry, Single) else []
        target = f"file {' or '.join(files)}" if files else f"folder {name}"
        raise MissingDataError(
            f"{name}: its weights ({size}) are not on this machine, and a download failed "
            f"({first_line(error)}); get them from {entry.source} and put the {target} into "
            f"{weights_folder()}, or set TEXGS_WEIGHTS"
        ) from error
