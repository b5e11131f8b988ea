"""Download volumes once, into the cache folder, with a checksum."""

from pathlib import Path

from texgs.core.errors import ArgumentError
from texgs.core.folders import cache_folder
from texgs.core.names import file_name


def download(url: str, sha256: str | None, name: str) -> Path:
    """Path of a file in the cache; downloaded with a progress bar unless it is there and whole.

    Args:
        url: http or https address.
        sha256: hexadecimal checksum of the file; without one it is not downloaded.
        name: file name in the cache.

    Raises:
        ArgumentError: if there is no checksum, the address does not answer, or the file differs from its
            checksum; nothing is kept then.
    """
    if not sha256 or not sha256.isalnum():
        raise ArgumentError(
            f"{name}: expected a checksum for {url}, got {sha256!r}; set dataset.volume.sha256"
        )
    import pooch

    file_name("dataset.volume.file", name)
    pooch.get_logger().setLevel("WARNING")
    folder = cache_folder() / "volumes" / sha256[:12]  # another checksum is another file
    try:
        return Path(pooch.retrieve(url, f"sha256:{sha256}", name, folder, progressbar=True))
    except ValueError as error:
        raise ArgumentError(
            f"{url}: expected the checksum {sha256}, got another file; look at the address"
        ) from error
    except OSError as error:
        raise ArgumentError(
            f"{url}: cannot be downloaded ({error}); get the file elsewhere and put it into data_folder"
        ) from error
