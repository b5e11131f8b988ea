"""Files and keys that are refused: what is wrong with them, and the file or key that the sentence names."""

import gzip
import zipfile
from functools import partial
from pathlib import Path

import h5py
import nibabel
import nrrd
import numpy as np
import pytest
import pyvista
import SimpleITK as sitk
import tifffile
from pydicom.encaps import encapsulate
from pydicom.uid import JPEG2000Lossless, UltrasoundMultiFrameImageStorage, generate_uid

from tests.volume.dicom_files import (
    FRAMES,
    change,
    frame,
    group,
    save,
    write_enhanced,
    write_nuclear,
    write_phases,
    write_series,
    write_steps,
)
from tests.volume.test_extra_axis import write_nrrd
from tests.volume.test_netcdf import FIELD, write_axes, write_netcdf
from tests.volume.test_text_columns import DIMS as LINE_DIMS
from tests.volume.test_text_columns import LINES, write_lines
from tests.volume.test_tiff import A, folder_of, ome, split
from tests.volume.volume_files import BY_A_PROCESS, WRITERS, sample_values, whole
from tests.volume.zarr_files import all_axes, axes_of, write_image
from texgs.core.errors import TexgsError
from texgs.volume.sources import FORMATS

VALUES = sample_values()  # [11, 12, 13]
RGB = np.zeros((4, 5, 6, 3), np.uint8)
FLAT, FIVE = np.zeros((12, 13), np.uint8), np.zeros((2, 2, 11, 12, 13), np.uint8)
COMPLEX = sample_values("complex64")
PIXEL = np.dtype([("R", "u1"), ("G", "u1"), ("B", "u1")])
POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 52428800\n"
LOGIN = b"\n<!DOCTYPE html>\n<html><head><title>Sign in</title></head></html>"
NRRD = "NRRD0004\ntype: {kind}\ndimension: 3\nsizes: {sizes}\nencoding: {encoding}\n{more}\n"
GZIPPED = gzip.compress(bytes(24))


def data(content):
    return lambda path: path.write_bytes(content)


def of_nrrd(content=bytes(24), kind="uchar", sizes="4 3 2", encoding="raw", more=""):
    return data(NRRD.format(kind=kind, sizes=sizes, encoding=encoding, more=more).encode() + content)


def of_meta(content=bytes(12), dims="3 2 2", more=""):
    n_dims = len(dims.split())
    text = f"NDims = {n_dims}\nDimSize = {dims}\n{more}ElementType = MET_UCHAR\nElementDataFile = LOCAL\n"
    return data(text.encode() + content)


def of_vtk(content):
    return data(f"# vtk DataFile Version 3.0\nname\nASCII\n{content}".encode())


def of_tiff(values, **options):
    return lambda path: tifffile.imwrite(path, values, **{"photometric": "minisblack", **options})


def of_nifti(values):
    return lambda path: nibabel.save(nibabel.Nifti1Image(values, np.eye(4)), path)


def of_pynrrd(values, **header):
    return lambda path: nrrd.write(str(path), values, header, index_order="C")


def of_itk(values, is_vector=False):
    return lambda path: sitk.WriteImage(sitk.GetImageFromArray(values, isVector=is_vector), path)


def of_hdf5(said=None, labels=(), **arrays):
    def write(path):
        with h5py.File(path, "w") as file:
            for name, values in arrays.items():
                file[name] = values
                file[name].attrs.update(said or {})
            for axis, label in zip(file["v"].dims if labels else (), labels, strict=True):
                axis.label = label

    return write


def of_zarr(values, names="zyx", scale=None):
    return lambda path: write_image(path, [values], axes_of(names), [scale or [1.0] * len(names)])


def of_slices(names, more=""):
    """Write single TIFFs into a folder, and another file."""

    def write(path):
        folder_of(path, dict.fromkeys(names.split(), A[0]))
        _ = more and (path / more).touch()

    return write


def edited(name, before, after):
    """Write a file by its writer, and replace words of its header."""

    def write(path):
        WRITERS[name](path, VALUES)
        content = path.read_bytes()
        assert before in content
        path.write_bytes(content.replace(before, after))

    return write


def in_folder(write, *arguments, **options):
    """Write files into a new folder."""

    def write_into(path):
        path.mkdir()
        write(path, *arguments, **options)

    return write_into


def without(name, write):
    """Take one file of a folder away."""
    return lambda path: (write(path), (path / name).unlink())


def huge_plane(path):
    with h5py.File(path, "w") as file:
        file.create_dataset("v", (4, 3_000_000, 3_000_000), "f4", chunks=(1, 1000, 1000))


def huge_pages(path):
    tifffile.imwrite(path, VALUES, compression="zlib")
    with tifffile.TiffFile(path, mode="r+") as tiff:
        for page in tiff.pages:
            page.tags["ImageWidth"].overwrite(2_000_000)
            page.tags["ImageLength"].overwrite(2_000_000)


def huge_nifti(path):
    image = nibabel.Nifti1Image(sample_values("int16").T, np.eye(4))
    image.header.set_data_shape((30000, 30000, 30000))
    path.write_bytes(gzip.compress(image.header.binaryblock + bytes(9000)))


def pointed(path):
    of_nrrd(more="data file: v.raw\n")(path)
    path.with_name("v.raw").write_bytes(POINTER)


in_time = partial(write_nrrd, place=3, kind="time", encoding="raw")


def cut_step(path):
    in_time(path)
    path.write_bytes(path.read_bytes()[:-1])


def one_slice(path):
    write_series(path.parent, VALUES[:1])
    next(path.parent.glob("*-3.ima")).rename(path)


def zip_of(*names):
    def write(path):
        with zipfile.ZipFile(path, "w") as archive:
            for name in names:
                archive.writestr(name, "x")

    return write


def curved(path):
    pyvista.RectilinearGrid(*map(np.arange, (3.0, 4.0, 5.0))).cast_to_structured_grid().save(path)


def of_frames(*places, stacks=False):
    frames = [frame(z, content={"StackID": str(z > 2)} if stacks else None) for z in places]
    return partial(write_enhanced, values=FRAMES, frames=frames)


def film(path):
    tags = {"FrameTime": 33, "FrameIncrementPointer": 0x00181063, "SpacingBetweenSlices": 2.0}
    save(path, FRAMES, UltrasoundMultiFrameImageStorage, **tags)


def spoilt(folder):
    """Write slices with streams that no decoder knows."""

    def spoil(data):
        data.file_meta.TransferSyntaxUID = JPEG2000Lossless
        data.PixelData = encapsulate([b"no such stream"])
        data["PixelData"].is_undefined_length = True

    series(folder)
    change(folder, spoil)


def at(*heights):
    """Write slices at places along z."""
    return in_folder(write_series, VALUES[:5], [(0, 0, z) for z in heights])


def series_with(name, shorten):
    """Write slices, and change the bytes of one file."""

    def write(folder):
        series(folder)
        content = (folder / name).read_bytes() if (folder / name).exists() else b""
        (folder / name).write_bytes(shorten(content))

    return write


def unlike(folder):
    """Write slices of two sizes in one series."""
    folder.mkdir()
    write_series(folder, VALUES[:4])
    write_series(folder, VALUES[:1, :5], [(10, 10, 40)], number=9)


def two_lattices(folder):
    folder.mkdir()
    for number, rows in ((1, 12), (2, 7)):
        write_series(folder, VALUES[:4, :rows], number=number, uid=generate_uid())


def phases(**tags):
    return in_folder(write_phases, {"SeriesDescription": lambda t: "Bone", **tags})


NO_SCALARS = "DATASET STRUCTURED_POINTS\nDIMENSIONS 3 3 3\nORIGIN 0 0 0\nSPACING 1 1 1\n"
OTHER_FILE = '<BinaryOnly MetadataFile="all.ome" UUID="urn:uuid:1"/>'
RAW = {"dims": (13, 12, 11), "dtype": "uint16"}
NC = partial(write_netcdf, fields={"temperature": FIELD, "vx": FIELD})
UNEVEN = ([0, 1, 4, 9], np.arange(5), np.arange(6))
ALL = {"series": "all"}
STEPS = {"TemporalPositionIdentifier": lambda step, z: step}
PHASES = {"TemporalPositionIdentifier": lambda t: t}
series, steps = in_folder(write_series, VALUES), in_folder(write_steps, STEPS)
PLAIN = [
    ({}, "no header; set dims and dtype, and endian"),
    ({"dims": (13, 12, 11)}, "set dtype, and endian"),
    (RAW | {"dtype": "float32"}, "6864 bytes, found 3432; dtype uint16 would fit"),
    (RAW | {"dims": (13, 12, 10), "skip": 8}, "= 3128 bytes, found 3432; correct dims"),
    (RAW | {"dtype": "short int"}, "dtype: expected a name"),
    (RAW | {"dims": (-13, -12, 11)}, "dims: expected at least 2"),
    (RAW | {"dtype": "complex64"}, "dtype: expected integers, floats or bool, got complex64"),
    (RAW | {"spacing": (1, 1, float("nan"))}, "spacing: expected three finite numbers"),
    (RAW | {"endian": ">"}, "endian: expected little or big"),
]
NAMES = ".*: expected names that differ by the number of the slice"
COMPONENTS = "channel, .*: expected one of 0 to 2, got "
LONG = "expected an array of real numbers with three axes or more"
COLUMNS = [
    ({}, "set dims, and column where"),
    ({"dims": LINE_DIMS}, "column: expected a number from 1 to 10, got none"),
    ({"dims": (6, 5, 5), "column": 2}, "= 150 lines, found 120"),
    ({"dims": (6, 5, 3), "column": 2}, "= 90 lines, found more"),
    ({"dims": (6, 5, 1), "column": 2}, "dims: expected at least 2"),
]
# By names of files: what writes them, words of the sentence, and keys.
REFUSED = {
    "v.raw": [*((data(VALUES.tobytes()), words, keys) for keys, words in PLAIN)],
    "v.txt": [
        *((partial(write_lines, lines=LINES), words, keys) for keys, words in COLUMNS),
        (partial(write_lines, lines=["1 2", "3"]), "v.txt", {"dims": (2, 2, 2), "column": 2}),
    ],
    "v.txt.gz": [(data(gzip.compress(b"1\n" * 8)[:-4]), "expected text .* cut off", {"dims": (2, 2, 2)})],
    "none.vti": [(lambda path: None, "no such file or folder; looked for /")],
    "v.doc": [(Path.touch, r"unknown suffix '.doc'; expected .raw, .*, .nii.gz, .* or a folder of sli")],
    "v.raw.gz": [(Path.touch, "unknown suffix '.raw.gz'")],
    "v.zarr": [
        (data(b"zarr"), "unknown suffix '.zarr'"),
        (Path.mkdir, "expected a folder or zip of Zarr"),
        (of_zarr(VALUES[0], "yx"), f"{LONG}, got / of 12 x 13 uint16"),
        (of_zarr(VALUES + 1j), f"{LONG}, got / of 11 x 12 x 13 complex128"),
        (of_zarr(VALUES[:0]), f"{LONG}, got / of 0 x 12 x 13 uint16"),
        (of_zarr(all_axes(VALUES)[0], "qzyx"), "three axes of space besides time and channel, got q 3"),
        (of_zarr(VALUES, "zy"), "expected a folder or zip of Zarr, got zip"),
        (of_zarr(VALUES, scale=[float("nan"), 1, 1]), "spacing: expected three finite numbers"),
        (of_zarr(VALUES), "series: not for this format", {"series": "1"}),
    ],
    "empty": [(Path.mkdir, r"a folder of DICOM slices or TIFFs \(.tif, .tiff\), found none")],
    "v.npy": [
        (partial(np.save, arr=VALUES), "dims: not for this format", {"dims": (2, 2, 2)}),
        (partial(np.save, arr=COMPLEX), "integers, floats or bool, got complex64"),
        (partial(np.save, arr=np.array([[[{}]]]), allow_pickle=True), "expected a .npy file"),
        (partial(np.save, arr=RGB), "3 components per sample"),
        (partial(np.save, arr=FLAT), "expected a scalar field .* the shape"),
    ],
    "v.npz": [(partial(np.savez, a=VALUES, b=VALUES), "variable: expected one of a, b, got none")],
    "v": [
        (in_folder(lambda path: (path / "s1.tif").write_bytes(POINTER)), "s1.tif: .* Git LFS"),
        (in_folder(lambda path: (path / "s1.dcm").write_bytes(POINTER)), "s1.dcm: .* Git LFS"),
        (in_folder(lambda path: (path / "s1.tif").symlink_to("x")), "s1.tif: a link to x, which is not"),
        (without("part_1.ome.tif", in_folder(split)), "2 of 6 slices are missing; put part_1.ome.tif of"),
        (of_slices("s1", more="s1.dcm"), "slices of one format, got s1.tif and s1.dcm"),
        (of_slices("s2 s4 s8"), "s4.tif and s8.tif: expected numbers 2 apart, .* got 4"),
        (of_slices("z0_c0 z0_c1 z1_c0 z1_c1 z3_c0 z3_c1"), "z1_c0.tif and z3_c0.tif: exp"),
        *(
            (of_slices(names), f"{pair}{NAMES}")
            for names, pair in {
                "s0 s0_mask s1 s1_mask": "s0.tif and s0_mask.tif",
                "p0_z0 p0_z1 p1_z0 p1_z1": "p0_z0.tif and p1_z1.tif",
                "z0_c0 z0_c1 z1_c0": "z0_c0.tif and z1_c0.tif",
                "s1 s01 s2": "s.*1.tif and s2.tif",
                "left right": "left.tif and right.tif",
            }.items()
        ),
    ],
    "slices": [
        (at(0, 2, 4, 8, 10), "slices 2 mm apart, got 4 mm; complete the series"),
        (at(0, 2, 2, 4, 6), "slices at different places, got two at one"),
        (in_folder(write_series, VALUES[:5], [(0, 0.3 * z, 2.5 * z) for z in range(5)]), "correct the tilt"),
        (unlike, "expected size, spacing and orientation of"),
        (without("87-1.ima", steps), "each temporal position at .*, got 3 at 10 mm, 2"),
        (in_folder(write_steps, {}), "got two at one, and no temporal position or trigger time"),
        (phases(TemporalPositionIdentifier=lambda t: t or ""), "a temporal position in each", ALL),
        (phases(SeriesDescription=lambda t: f"{t // 2}0%"), "a percentage in each", ALL),
        (phases(SeriesDescription=lambda t: f"{t}0%" if t else "mean"), "a percentage in each", ALL),
        (phases(SeriesNumber=lambda t: 7), "a series number in each", ALL),
        (two_lattices, "expected series on one lattice, more than on any other, got ", ALL),
        (without("15-6.ima", phases(**PHASES)), r"as long as \d \(Bone, 5 files", ALL),
        (in_folder(lambda path: (path / "slices").mkdir()), "open the folder with the slices, in slices$"),
        (series_with("44-3.ima", lambda x: x[:-100]), "44-3.ima: cut off, damaged"),
        (series_with("05-3.DCM", lambda x: b"no slice"), "05-3.DCM: cut off, damaged or no file of DICOM"),
        (spoilt, "slices"),
        (steps, r"dataset\.volume\.time: expected one of 0 to 2, got 3$", {"time": 3}),
        (phases(**PHASES), "or series=all for those alike, as steps in time, of "),
    ],
    "v.nii.gz": [
        (lambda path: path.symlink_to("../.git/annex/v"), "annex/v, which is not there; get it"),
        (data(bytes(400)), "expected gzip, got another file; .*, rename it to v.nii$"),
        (huge_nifti, "30000 x 30000 x 30000 samples"),
    ],
    "v.nhdr": [
        (pointed, "Git LFS"),
        (of_nrrd(more="data file: none.raw\n"), "no such file with samples: .*none.raw"),
    ],
    "v.nii": [
        (data(GZIPPED), "is not packed, got gzip; rename it to v.nii.gz"),
        (of_nifti(np.zeros((4, 5, 6), PIXEL)), "3 components per sample"),
        (of_nifti(COMPLEX), "integers, floats or bool, got complex64"),
        (of_nifti(FLAT), "expected .*(axes|shape|samples along)"),
        (of_nifti(FIVE.T), "expected .*(axes|shape|samples along)"),
    ],
    "v.zip": [
        (zip_of(*(f"ct/{k}.dcm" for k in range(9))), "a zip of Zarr, got one of ct/0.dcm, .*; unp"),
        (zip_of(), "a (folder or )?zip of Zarr"),
        (data(b"PK\x03\x04 nonsense"), "a folder or zip of Zarr, got File is not a zip file"),
    ],
    "v.mha": [
        (edited("plain.mha", b"1 0 0 0 1 0 0 0 1", b"1 0 0 1 0 0 0 0 1"), "three independent axes"),
        (of_meta(more="ElementSpacing = 2 x 2\n"), "could not convert string to float: 'x'"),
        (of_meta(RGB.tobytes(), "6 5 4", "ElementNumberOfChannels = 3\n"), COMPONENTS),
        (of_meta(dims="13 12 11 2 2"), "expected 3 axes"),
        (of_itk(np.zeros((2, 3, 3, 3, 2)), True), "expected a scalar volume"),
    ],
    "v.nrrd": [
        (of_pynrrd(FIVE), "expected 3 axes"),
        (of_pynrrd(RGB[0], kinds=["RGB-color", "domain", "domain"]), "3 components per sample"),
        (of_pynrrd(RGB, kinds=["RGB-color", *3 * ["domain"]]), COMPONENTS),
        (cut_step, "the file is cut off"),
        (in_time, r"dataset.volume.time: expected one of 0 to 2, got 3$", {"time": 3}),
        (in_time, "dataset.volume.channel: there is no such axis; leave it out", {"channel": "1"}),
        (of_nrrd(b"1 2 3 4 5 6 7 40000", "short", "2 2 2", "ascii"), "expected samples of int16, got 40000"),
        (of_nrrd(b"1 2 3 4 5 6 7 -1", "uint", "2 2 2", "ascii"), "expected samples of uint32, got -1"),
        (of_nrrd(b"1 " * 25, encoding="ascii"), "expected 24 samples, found 25"),
        (of_nrrd(b"1 2 x " + b"3 " * 21, encoding="ascii"), "an? .?n?rrd file"),
        (of_nrrd(encoding="gzip", more="line skip: 99999999999\n"), "line skip: expected"),
        (of_nrrd(GZIPPED, "uchar", "100000 10000 1000", "gzip"), "100000 x 10000 x 1000 .* needs"),
    ],
    "v.vtk": [
        (of_vtk("DATASET POLYDATA\nPOINTS 1 float\n0 0 0\n"), "expected image data .*, got PolyData"),
        (of_vtk(NO_SCALARS), "scalars of points or cells, got none"),
        (edited("binary.vtk", b"S 13 12 11", b"S 9000 9000 9000"), "9000 x 9000 x 9000 .* needs"),
    ],
    "v.vts": [(curved, "expected image data .*, got StructuredGrid; resample it")],
    "v.vti": [
        (partial(WRITERS["packed.vti"], values=RGB), "3 components per sample"),
        (edited("packed.vti", b"0 12 0 11 0 10", b"0 99999 0 99999 0 9999"), "00 x 100000 x 10000 .* needs"),
    ],
    "v.tif": [
        (of_tiff(RGB, photometric="rgb"), "3 components per sample"),
        (of_tiff(FLAT), "expected .*(axes|shape|samples along)"),
        (of_tiff(FIVE), "expected .*(axes|shape|samples along)"),
        (of_tiff(A, metadata={"axes": "XYZ"}), "expected pages with Y and X, got the axes XYZ"),
        (of_tiff(A[:3], imagej=True, metadata={"axes": "CYX"}), "three axes of space .*, got T 1"),
        (huge_pages, "2000000 x 2000000 x .* samples"),
        (of_tiff(A, **ome("urn:uuid:2", OTHER_FILE)), "a part of all.ome"),
    ],
    "v.nc": [
        (NC, rf"variable: {LONG}, got none; choose one of temperature, vx$"),
        (NC, "got vy; choose one of temperature, vx", {"variable": "vy"}),
        (NC, "column: not for this format", {"variable": "vx", "column": 2}),
        (NC, "time: there is no such axis in lat 4 x r 5 x lon 6", {"variable": "vx", "time": 1}),
        (NC, "channel: there is no such axis", {"variable": "vx", "channel": "0"}),
        (partial(write_axes, places=UNEVEN, units=3 * ["m"]), "even distances along z; resample"),
        (data(b"CDF\x05" + bytes(2000)), "convert it: nccopy -k nc4 OLD.nc NEW.nc"),
        (data(b"\x89HDF\r\n\x1a\n" + bytes(2000)), "expected an HDF5 or NetCDF file, got .*"),
    ],
    "v.h5": [
        (of_hdf5(table=VALUES[0]), f"{LONG}, got none; choose one of another file"),
        *(
            (
                of_hdf5(**{"a/t": VALUES, "flat": FLAT}),
                f"{LONG}, got {got}; choose one of a/t",
                {"variable": name},
            )
            for name, got in (("a", "a"), ("flat", "flat of 12 x 13 uint8"))
        ),
        (of_hdf5({"scale_factor": "half"}, v=VALUES), "scale_factor: expected a number, got half"),
        (of_hdf5(**{f"step{k:02}": VALUES for k in range(20)}), "one of step00, .*, step07 and 12 more"),
        (of_hdf5(v=RGB), f"{COMPONENTS}none$"),
        *((of_hdf5(v=RGB), f"{COMPONENTS}{got}$", {"channel": got}) for got in ("3", "-1")),
        (
            of_hdf5(labels=["time", "height", "width"], v=VALUES),
            "three axes of space besides time and channel",
        ),
        (of_hdf5(labels=["member", *"zyx"], v=np.zeros((2, 3, 4, 5))), "three axes .*, got member 2 x z"),
        (huge_plane, "3000000 x 3000000 x 1 samples of float32: needs 33528 GiB"),
    ],
    "v.ima": [(one_slice, "at least 2 slices, got 1; open")],
    "DICOMDIR": [(Path.touch, "a list of files of DICOM; open the folder")],
    "e.dcm": [
        (data(b"no slice"), "expected a slice with its position and orientation, found none"),
        (partial(write_nuclear, EnergyWindowVector=[1, 1, 1, 2, 2]), "EnergyWindowVector, which tells none"),
        (film, "of 5 frames, got FrameTime, which tells none; convert it"),
        (of_frames(0, 1, 2, 4, 5), "frame 2 of e.dcm and frame 3 .*, got 5 mm.* dcm2niix$"),
        (of_frames(0, 0, 1, 1, 2), "slices at different places, got two at one.* dcm2niix$"),
        (of_frames(0, 1, 2, 3), "expected places of 5 frames, got 4.* dcm2niix$"),
        (of_frames(*range(5), stacks=True), "one stack of frames, got False, True.* dcm2niix$"),
        (partial(write_enhanced, values=FRAMES, frames=5 * [group()]), "found none; convert it: dcm2niix$"),
    ],
}
ROWS = [(name, *row) for name, rows in REFUSED.items() for row in rows]
ROWS += [(f"v{suffix}", data(POINTER), "a pointer of Git LFS in its place") for suffix in FORMATS]
ROWS += [(f"v{suffix}", data(LOGIN), "a page of HTML in its place") for suffix in FORMATS]


# A process of its own reads these, in half a second or more.
PROCESS = (*BY_A_PROCESS, ".vts", ".dcm", ".ima", "slices")
MARKS = {True: pytest.mark.subprocess, False: ()}


@pytest.mark.parametrize(
    "row",
    [pytest.param(row, id=f"{row[0]}: {row[2]}"[:60], marks=MARKS[row[0].endswith(PROCESS)]) for row in ROWS],
)
def test_refused(tmp_path, capfd, row):
    name, write, words, keys = (*row, {})[:4]
    write(tmp_path / name)
    with pytest.raises(TexgsError, match=words) as caught:
        whole(tmp_path / name, **keys)
    assert str(caught.value).startswith(str(tmp_path / name))
    assert capfd.readouterr() == ("", "")
