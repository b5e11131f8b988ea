"""Files that hold parts of a volume besides the one that is named: results depend on these, too."""

import re
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from texgs.core.errors import TexgsError
from texgs.core.io import reading_as
from texgs.volume.headers import samples_of

OME_FILE = re.compile(r'<UUID [^>]*FileName="([^"]+)"')
PIECE = re.compile(rb'<Piece [^>]*Source="([^"]+)"')


def parts_of(path: Path) -> list[Path]:
    """Return the files that hold parts of a volume, besides the one that is named, as far as they are there.

    Samples beside a header, pieces of VTK, files of one OME-TIFF, and files that HDF5 links to or makes
    virtual arrays of. What cannot be read has none: whoever reads it tells.
    """
    suffix, files = path.suffix.lower(), set[Path]()
    with suppress(TexgsError), reading_as("a volume"):
        names: Iterable[Path | str] = filter(None, [samples_of(path)])
        if suffix in (".tif", ".tiff"):
            import tifffile

            with tifffile.TiffFile(path) as tiff:
                names = OME_FILE.findall(tiff.ome_metadata or "")
        elif suffix in (".pvti", ".pvtr"):
            names = [name.decode() for name in PIECE.findall(path.read_bytes())]
        elif suffix in (".nc", ".nc4", ".h5", ".hdf5", ".hdf", ".nxs"):
            names = _of_hdf5(path)
        files = {(path.parent / name).resolve() for name in names}
    return sorted(file for file in files - {path.resolve()} if file.is_file())


def _of_hdf5(path: Path) -> Iterable[str]:
    """Return the names of files that are linked to, and of those that virtual arrays are made of."""
    import h5py

    from texgs.volume.netcdf import arrays_in

    if not h5py.is_hdf5(path):
        return []
    with h5py.File(path, "r") as file:
        arrays = arrays_in(file)[0].values()
        virtual = [array for array in arrays if array.is_virtual]
        sources = [source.file_name for array in virtual for source in array.virtual_sources()]
        return {name for name in [*sources, *(array.file.filename for array in arrays)] if name != "."}
