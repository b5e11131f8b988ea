"""Images, steps, channels and files of TIFF: the right ones are read, and everything else is refused."""

import shutil
import uuid
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image

from tests.volume.volume_files import assert_holds, sample_values, whole
from texgs.core.errors import ArgumentError
from texgs.volume.slabs import RawSource
from texgs.volume.sources import open_source
from texgs.volume.tiff import raise_complaints

A = sample_values()[:6]  # [6, 12, 13]
B = A[::-1] + 1000
UM = {"PhysicalSizeX": 0.5, "PhysicalSizeY": 0.5, "PhysicalSizeZ": 2.0}


def positions(path: Path, **options) -> Path:
    """Two positions of a stage in an OME-TIFF; the second one has wider slices."""
    with tifffile.TiffWriter(path, ome=True) as file:
        for name, values, depth in (("left", A, 2.0), ("right", B, 4.0)):
            told = {"axes": "ZYX", "Name": name, **UM, "PhysicalSizeZ": depth}
            file.write(values, metadata=told, **options)
    return path


@pytest.mark.parametrize("compression", [None, "zlib"])
def test_an_image_of_several_is_chosen_by_name_or_number(tmp_path, compression):
    path = positions(tmp_path / "v.ome.tif", compression=compression)
    for chosen, values, depth in (("left", A, 2.0), ("1", B, 4.0), ("right", B, 4.0), ("0", A, 2.0)):
        assert_holds(path, values, (0.5, 0.5, depth), image=chosen)
    for keys, got in (({}, "none"), ({"image": "middle"}, "middle")):
        with pytest.raises(ArgumentError, match=rf"0 \(left 13 x 12 x 6\), 1 \(right 13 .*, got {got}"):
            open_source(path, **keys)


def test_series_that_were_appended_are_not_one_on_top_of_the_other(tmp_path):
    path = tmp_path / "v.tif"
    for values in (A, B):
        tifffile.imwrite(path, values, append=True, photometric="minisblack")
    assert_holds(path, B, image="1")
    with pytest.raises(ArgumentError, match=r"one of 0 \(13 x 12 x 6\), 1 \(13 x 12 x 6\), got none"):
        open_source(path)


@pytest.mark.parametrize("reduced", [0, 1])
def test_a_thumbnail_is_no_slice_and_pages_may_be_compressed_in_different_ways(tmp_path, reduced):
    with tifffile.TiffWriter(tmp_path / "v.tif") as file:
        for z, plane in enumerate(A):
            compression = "zlib" if z % 2 else None
            file.write(plane, photometric="minisblack", metadata=None, compression=compression)
        file.write(A[3, ::2, ::2], photometric="minisblack", metadata=None, subfiletype=reduced)
    assert_holds(tmp_path / "v.tif", A)


def test_a_note_says_that_an_image_is_the_only_volume(tmp_path):
    with tifffile.TiffWriter(tmp_path / "v.tif") as file:
        file.write(np.zeros((7, 5), np.uint8))
        file.write(A, photometric="minisblack")
    assert open_source(tmp_path / "v.tif").note.startswith("image 1 of 2, the only volume; TIFF tells no")
    assert_holds(tmp_path / "v.tif", A)


def test_the_largest_level_of_a_pyramid_is_read(tmp_path):
    with tifffile.TiffWriter(tmp_path / "v.ome.tif", ome=True) as file:
        file.write(A, subifds=1, tile=(16, 16), metadata={"axes": "ZYX", **UM})
        file.write(A[:, ::2, ::2], subfiletype=1, tile=(16, 16))
    assert_holds(tmp_path / "v.ome.tif", A, (0.5, 0.5, 2.0))


def hyperstack(axes: str) -> np.ndarray:
    """Samples 100 t + 50 c + z + something of the place, with axes in this order."""
    t, c, z = np.ogrid[:3, :2, :4]
    field = (100 * t + 50 * c + z)[..., None, None] + np.arange(20).reshape(4, 5)
    return field.transpose(["TCZYX".index(axis) for axis in axes]).astype(np.uint16)


@pytest.mark.parametrize("compression", [None, "zlib"])
@pytest.mark.parametrize("axes", ["TZCYX", "TCZYX", "ZTCYX", "ZCTYX", "CTZYX", "CZTYX"])
def test_any_order_of_time_channels_and_slices(tmp_path, axes, compression):
    path, told = tmp_path / "v.ome.tif", {"axes": axes, "Channel": {"Name": ["DAPI", "GFP"]}, **UM}
    tifffile.imwrite(path, hyperstack(axes), ome=True, metadata=told, compression=compression)
    for t, c, name in ((0, 0, "DAPI"), (2, 1, "GFP"), (1, 1, "1")):
        source = open_source(path, time=t, channel=name)
        np.testing.assert_array_equal(source.slices(0, 4), hyperstack("TCZYX")[t, c])
        np.testing.assert_array_equal(source.slices(1, 3), hyperstack("TCZYX")[t, c, 1:3])
        assert (source.n_steps, source.spacing) == (3, (0.5, 0.5, 2.0))
        assert [each.label for each in source.channels] == ["DAPI", "GFP"]
        assert source.channel == source.channels[c]
    assert open_source(path, channel="0").note == "step 0 of 3; dataset.volume.time chooses another"
    with pytest.raises(ArgumentError, match=r"expected one of 0 \(DAPI\), 1 \(GFP\), got none"):
        open_source(path)


@pytest.mark.parametrize("compression", [None, "zlib"])
def test_a_hyperstack_of_imagej(tmp_path, compression):
    path, told = tmp_path / "v.tif", {"axes": "TZCYX", "spacing": 3.0, "unit": "um"}
    kinds = {"imagej": True, "metadata": told, "resolution": (2, 2), "compression": compression}
    tifffile.imwrite(path, hyperstack("TZCYX"), **kinds)
    assert_holds(path, hyperstack("TCZYX")[2, 1], (0.5, 0.5, 3.0), time=2, channel="1")


def test_one_header_for_a_whole_hyperstack(tmp_path):
    """As ImageJ writes stacks above 4 GB: pages behind the first one have no header."""
    values, path = hyperstack("TZCYX"), tmp_path / "v.tif"
    tifffile.imwrite(path, values, imagej=True, metadata={"axes": "TZCYX"}, truncate=True)
    with tifffile.TiffFile(path) as file:
        assert len(file.pages) == 1
    assert_holds(path, hyperstack("TCZYX")[1, 1], time=1, channel="1")
    tifffile.imwrite(path, hyperstack("TCZYX")[:, 0], imagej=True, metadata={"axes": "TZYX"})
    assert isinstance(open_source(path, time=1), RawSource)  # a step that lies in one piece
    assert_holds(path, hyperstack("TCZYX")[1, 0], time=1)


def test_steps_alone_are_taken_for_slices_and_it_is_said(tmp_path):
    tifffile.imwrite(tmp_path / "v.tif", A, imagej=True, metadata={"axes": "TYX"})
    assert_holds(tmp_path / "v.tif", A)
    assert "steps of time are taken for slices" in open_source(tmp_path / "v.tif").note


NANOMETRES = {"PhysicalSizeX": 500, "PhysicalSizeXUnit": "nm", "PhysicalSizeY": 0.25, "PhysicalSizeZ": 3.0}


@pytest.mark.parametrize(
    "written",
    [
        {"imagej": True, "resolution": (2, 4), "metadata": {"spacing": -3.0, "unit": "um", "axes": "ZYX"}},
        {"ome": True, "metadata": {"axes": "ZYX", **NANOMETRES}},
    ],
)
def test_the_spacing_that_microscopes_write(tmp_path, written):
    tifffile.imwrite(tmp_path / "v.tif", A, photometric="minisblack", **written)
    x, y, z = open_source(tmp_path / "v.tif").spacing
    assert (y / x, z / x) == pytest.approx((0.5, 6.0))
    assert open_source(tmp_path / "v.tif").note == ""
    assert_holds(tmp_path / "v.tif", A)
    assert open_source(tmp_path / "v.tif", spacing=(1.0, 1.0, 2.0)).spacing == (1, 1, 2)


def ome(own: str, images: str) -> dict[str, object]:
    """Arguments of tifffile for a file of an OME-TIFF in several."""
    space = 'xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06"'
    xml = f'<?xml version="1.0"?><OME {space} UUID="{own}">{images}</OME>'
    return {"description": xml, "metadata": None, "photometric": "minisblack"}


def ome_image(name: str, depth: float, planes: str) -> str:
    size = 'SizeX="13" SizeY="12" SizeZ="6" SizeC="1" SizeT="1" PhysicalSizeX="1" PhysicalSizeY="1"'
    return (
        f'<Image ID="Image:{name}" Name="{name}"><Pixels ID="Pixels:{name}" DimensionOrder="XYZCT" '
        f'Type="uint16" {size} PhysicalSizeZ="{depth}"><Channel ID="C:0" SamplesPerPixel="1"/>{planes}'
        "</Pixels></Image>"
    )


def plane_in(name: str, index: int, page: int, z: int) -> str:
    return (
        f'<TiffData IFD="{page}" FirstZ="{z}" FirstC="0" FirstT="0" PlaneCount="1">'
        f'<UUID FileName="{name}">urn:uuid:{uuid.UUID(int=index + 1)}</UUID></TiffData>'
    )


def split(folder: Path) -> list[Path]:
    """An OME-TIFF of six slices in three files, two in each."""
    names = [f"part_{k}.ome.tif" for k in range(3)]
    planes = "".join(plane_in(names[z // 2], z // 2, z % 2, z) for z in range(6))
    for k, name in enumerate(names):
        told = ome(f"urn:uuid:{uuid.UUID(int=k + 1)}", ome_image("one", 3, planes))
        tifffile.imwrite(folder / name, A[2 * k : 2 * k + 2], **told)
    return [folder / name for name in names]


def test_of_positions_in_a_file_each_the_one_in_the_file_is_read(tmp_path):
    names = ["left.ome.tif", "right.ome.tif"]
    planes = ["".join(plane_in(name, k, z, z) for z in range(6)) for k, name in enumerate(names)]
    both = "".join(ome_image(*each) for each in zip(("left", "right"), (2, 4), planes, strict=True))
    for k, (name, values) in enumerate(zip(names, (A, B), strict=True)):
        tifffile.imwrite(tmp_path / name, values, **ome(f"urn:uuid:{uuid.UUID(int=k + 1)}", both))
    assert_holds(tmp_path / names[1], B, (1, 1, 4))
    assert open_source(tmp_path / names[1]).note == "image 1 of 2, the only one with pages in this file"
    assert_holds(tmp_path / names[1], A, (1, 1, 2), image="left")
    with pytest.raises(ArgumentError, match=r"volume.image: expected one of 0 \(left .*\), 1 \(right .*none"):
        open_source(tmp_path)
    (tmp_path / names[0]).unlink()
    assert_holds(tmp_path / names[1], B, (1, 1, 4))


def test_an_ome_tiff_in_several_files_is_whole_from_any_of_them_and_from_their_folder(tmp_path):
    for path in (*split(tmp_path), tmp_path):
        assert_holds(path, A, (1, 1, 3))
    shutil.copy(split(tmp_path)[0], tmp_path / "z.tif")
    with pytest.raises(
        ArgumentError, match=r"part_0.ome.tif and z.tif: .* the second is not of it; move it away"
    ):
        open_source(tmp_path)


def test_what_tifffile_only_warns_of_is_an_error_where_samples_are_lost():
    expected = pytest.raises(ArgumentError, match=r"cut off, tifffile says: MMStack series is missing files")
    with expected, raise_complaints():
        tifffile.logger().warning("MMStack series is missing files. Returning subset (1, 2) of (2, 2)")


@pytest.mark.parametrize("tag", ["StripOffsets", "StripByteCounts"])
def test_pages_whose_samples_were_never_written_are_refused(tmp_path, tag):
    tifffile.imwrite(tmp_path / "v.tif", A, compression="zlib", photometric="minisblack", rowsperstrip=6)
    with tifffile.TiffFile(tmp_path / "v.tif", mode="r+") as file:
        entry = file.pages[4].aspage().tags[tag]
        entry.overwrite((entry.value[0], 0))
    with pytest.raises(ArgumentError, match=r"v.tif: expected a whole page, got samples that were never"):
        whole(tmp_path / "v.tif")


def folder_of(folder: Path, names: dict[str, np.ndarray]) -> Path:
    folder.mkdir()
    for name, plane in names.items():
        tifffile.imwrite(folder / f"{name}.tif", plane)
    return folder


@pytest.mark.parametrize("name", ["s{}_ch{}", "img_channel{1:03}_position000_z{0:03}"])
def test_a_folder_with_channels_beside_slices(tmp_path, name):
    planes = {name.format(z, c + 1): (A, B)[c][z] for z in range(6) for c in range(2)}
    folder = folder_of(tmp_path / "v", planes)
    assert_holds(folder, A, channel="1")
    assert_holds(folder, B, channel="2")
    with pytest.raises(ArgumentError, match=r"channel, .*: expected one of 0 \(1\), 1 \(2\), got none"):
        open_source(folder)


def test_a_folder_with_steps_beside_slices(tmp_path):
    folder = folder_of(tmp_path / "v", {f"t{t}_z{z}": A[z] + 7 * t for z in range(6) for t in range(3)})
    for t in range(3):
        assert_holds(folder, A + 7 * t, time=t)
    assert open_source(folder).note.startswith("step 0 of 3; dataset.volume.time chooses another; TIFF tells")


@pytest.mark.parametrize("name", ["s{:03}", "2026-11-30_run12_{:04}", "{}", "t{}_2 mm"])
def test_one_number_counts_slices_whatever_is_around_it(tmp_path, name):
    planes = {name.format(z + 8): plane for z, plane in enumerate(A)}
    assert_holds(folder_of(tmp_path / "v", planes), A)


@pytest.mark.skipif(find_spec("imagecodecs") is None, reason="needs imagecodecs: pip install '.[tiff]'")
@pytest.mark.parametrize("predictor", [1, 2])
def test_lzw_is_read_with_the_extra(tmp_path, predictor):
    planes = [Image.fromarray(plane) for plane in A.astype(np.uint8)]
    more = {"save_all": True, "append_images": planes[1:], "compression": "tiff_lzw"}
    planes[0].save(tmp_path / "v.tif", **more, tiffinfo={317: predictor})
    with tifffile.TiffFile(tmp_path / "v.tif") as file:
        assert (file.pages[5].compression, file.pages[5].predictor) == (5, predictor)
    assert_holds(tmp_path / "v.tif", A)


def test_lzw_without_the_extra_names_it(tmp_path, monkeypatch):
    Image.fromarray(A[0].astype(np.uint8)).save(tmp_path / "v.tif", compression="tiff_lzw")
    monkeypatch.setattr("texgs.volume.tiff.find_spec", lambda name: None)
    with pytest.raises(ArgumentError, match=r"got LZW; save them so, or pip install '.\[tiff\]'"):
        open_source(tmp_path / "v.tif")
