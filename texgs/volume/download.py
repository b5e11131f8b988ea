"""Download volumes once, compared with their checksums."""

import sys
from pathlib import Path

from texgs.core.errors import ArgumentError, first_line


def download(url: str, sha256: str, path: Path) -> None:
    """Download a file with a line that says so and a progress bar, unless it is there and whole."""
    import pooch

    if not url.startswith(("http://", "https://")):
        raise ArgumentError(f"{url}: expected an address that begins with https:// or http://")
    pooch.get_logger().setLevel("WARNING")
    if not path.exists():
        print(f"{path}: downloading it from {url}", file=sys.stderr)
    try:
        pooch.retrieve(url, f"sha256:{sha256.lower()}", path.name, path.parent, progressbar=True)
    except OSError as error:
        raise ArgumentError(
            f"{url}: cannot be downloaded ({first_line(error)}); "
            f"get {path.name} elsewhere and name its folder by data_folder=FOLDER or TEXGS_DATA"
        ) from error
    except ValueError as error:
        raise ArgumentError(
            f"{url}: expected the checksum {sha256}, got another file; look at the address"
        ) from error


def require_whole(path: Path, sha256: str) -> None:
    """Require that a downloaded file has its checksum and was not damaged since."""
    import pooch

    if pooch.file_hash(str(path)) != sha256.lower():
        raise ArgumentError(f"{path}: expected the checksum {sha256}, got another; delete it and run again")
