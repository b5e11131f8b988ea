"""Volumes from arrays of other libraries: the same samples at the same places, and pictures of them."""

import io
from pathlib import Path

import numpy as np
import pytest
import pyvista
import xarray
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from pydicom.uid import generate_uid

import texgs
from tests.refusals import refused
from tests.volume.dicom_files import write_series
from tests.volume.zarr_files import axes_of, write_image
from texgs.core.camera import orbit
from texgs.core.errors import ArgumentError, ShapeError
from texgs.core.light import Light
from texgs.scene.scene import Scene, SceneModel, SceneVolume
from texgs.scene.scene_file import light_of
from texgs.scene.twin import Twin
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.nrrd_file import open_grid
from texgs.volume.overlay import overlay
from texgs.volume.render import Appearance
from texgs.volume.slice_keys import SliceKeys
from texgs.volume.slice_picture import slice_picture

RED = texgs.TransferFunction([[0.5, 0.0], [1.0, 0.5]], [[0.5, 1.0, 0.0, 0.0]])
BLUE = texgs.TransferFunction([[0.0, 0.0], [0.2, 0.1], [0.4, 0.0]], [[0.0, 0.0, 0.0, 1.0]])


def field(*shape):
    """A smooth field [Z, Y, X] that tells its axes from each other, float32."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, size) for size in shape), indexing="ij")
    return np.exp(-(x**2 + 2 * y**2 + 3 * z**2) + 0.3 * x + 0.2 * y).astype(np.float32)


def test_an_array_keeps_its_samples_and_places():
    values = field(5, 6, 7)
    volume = texgs.Volume(values, spacing=(1, 2, 3), origin=(4, 5, 6), name="hill")
    assert np.array_equal(volume.grid.values, values)
    assert (volume.grid.spacing, volume.grid.origin) == ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))
    assert volume.summary.minimum == values.min()
    assert volume.summary.maximum == values.max()
    assert repr(volume) == f"Volume hill: 7 x 6 x 5 float32, {values.min():g} to {values.max():g}"


def test_slices_and_places_are_those_of_the_samples():
    values = field(15, 16, 17)
    volume = texgs.Volume(values, spacing=(1, 2, 3), origin=(4, 5, 6))
    place = volume.place(4 + 3.2, 5 + 2 * 7, 6 + 3 * 9 - 1)
    assert (place.index, place.value) == ((3, 7, 9), values[9, 7, 3])
    assert place.position == (7.0, 19.0, 33.0)
    keys = SliceKeys("z", 9, window=(0.0, 2.0), width=170)
    expected = slice_picture(volume.grid, keys, {})
    assert np.array_equal(np.asarray(volume.slice("z", 9, window=(0, 2), width=170)), expected)
    assert np.asarray(volume.slice()).shape[1] == pytest.approx(800, abs=1)
    refused(lambda: volume.slice("axial"), "slice: expected all, or a number of x, y, z, got axial")
    refused(lambda: volume.place(0, 0, 0), "at: expected a place in the volume")


def test_z_of_nifti_points_up_unless_it_is_told_otherwise(tmp_path):
    nibabel = pytest.importorskip("nibabel")
    values = field(5, 6, 7)
    nibabel.save(nibabel.Nifti1Image(values.transpose(2, 1, 0), np.diag([1, 2, 3, 1])), tmp_path / "a.nii.gz")
    for up, expected in ((None, "+z"), ("+y", "+y"), ("-x", "-x")):
        given = {} if up is None else {"up": up}
        read = texgs.Volume(tmp_path / "a.nii.gz", **given)
        made = texgs.Volume(values, spacing=(1, 2, 3), up=expected)
        assert np.array_equal(read.grid.values, made.grid.values), up


@given(
    st.tuples(*[st.integers(2, 5)] * 3),
    st.tuples(*[st.floats(0.1, 10)] * 3),
    st.tuples(*[st.floats(-9, 9)] * 3),
)
def test_pyvista_gives_and_takes_the_same(shape, spacing, origin):
    values = field(*shape)
    before = texgs.Volume(values, spacing=spacing, origin=origin)
    image = before.to_pyvista()
    x, y, z = (size - 1 for size in image.dimensions)
    corner = image.points[image.find_closest_point(np.add(origin, np.multiply(spacing, (x, y, z))))]
    assert np.allclose(corner, np.add(origin, np.multiply(spacing, (x, y, z))), rtol=1e-6)
    after = texgs.Volume.from_pyvista(image)
    assert np.array_equal(after.grid.values, values)
    assert after.grid.spacing == pytest.approx(spacing)
    assert after.grid.origin == pytest.approx(origin)


def test_what_pyvista_finds_at_a_point_is_the_sample_there():
    values = field(4, 5, 6)
    image = texgs.Volume(values, spacing=(1, 2, 3), origin=(10, 0, 0), name="hill").to_pyvista()
    at = pyvista.PolyData(np.array([[10 + 2 * 1.0, 3 * 2.0, 1 * 3.0]])).sample(image)
    assert at.point_data["hill"][0] == values[1, 3, 2]


def test_xarray_is_known_by_names_and_coordinates():
    values = field(4, 5, 6)
    falling = {"x": np.linspace(0, 5, 6), "y": np.linspace(8, 0, 5), "z": [1.0, 1.5, 2.0, 2.5]}
    array = xarray.DataArray(values.transpose(2, 0, 1), dims=("x", "z", "y"), coords=falling)
    volume = texgs.Volume(array)
    assert np.array_equal(volume.grid.values, values[:, ::-1])
    assert volume.grid.spacing == (1.0, 2.0, 0.5)
    assert volume.grid.origin == (0.0, 0.0, 1.0)
    metres, kilometres = {"units": "m"}, {"units": "km"}
    array = xarray.DataArray(
        values,
        dims=("z", "y", "x"),
        coords={
            "z": ("z", [0.0, 1.0, 2.004, 3.0], kilometres),
            "y": ("y", 500.0 * np.arange(5), metres),
            "x": ("x", 500.0 * np.arange(6), metres),
        },
    )
    assert texgs.Volume(array).grid.spacing == pytest.approx((500, 500, 1000)), "as from a file"
    array["z"].attrs["units"] = "degrees"
    with pytest.warns(UserWarning, match="units along x, y, z are m, m, degrees"):
        assert texgs.Volume(array).grid.spacing == (1.0, 1.0, 1.0)
    uneven = xarray.DataArray(values, dims=("z", "y", "x"), coords={"x": [0, 1, 2, 3, 4, 9]})
    assert texgs.Volume(uneven, spacing=(1, 2, 3)).grid.spacing == (1.0, 2.0, 3.0)
    unnamed = texgs.Volume(xarray.DataArray(values, dims=("level", "lat", "lon")))
    assert np.array_equal(unnamed.grid.values, values)
    assert unnamed.grid.spacing == (1.0, 1.0, 1.0)


def test_turned_axes_of_pyvista_are_kept():
    image = texgs.Volume(field(3, 4, 5), spacing=(1, 2, 3), origin=(7, 8, 9), up="+z").to_pyvista()
    volume = texgs.Volume(image)
    assert np.array_equal(volume.to_pyvista().points, image.points)
    places = pyvista.ImageData(dimensions=(5, 4, 3), spacing=(1, 2, 3), origin=(7, 8, 9)).points
    order = [np.lexsort(each.round(3).T) for each in (places, image.points)]
    assert np.allclose(places[order[0]], np.asarray(image.points)[order[1]])
    assert np.array_equal(field(3, 4, 5).ravel()[order[0]], image.active_scalars[order[1]])


def test_cells_and_even_grids_of_pyvista_are_volumes():
    values = field(3, 4, 5)
    image = pyvista.ImageData(dimensions=(6, 5, 4), spacing=(1, 2, 3))
    image.cell_data["density"] = values.ravel()
    grid = pyvista.RectilinearGrid(np.arange(5.0), 2 * np.arange(4.0), 3 * np.arange(3.0))
    grid["density"] = values.ravel()
    for data, origin in ((image, (0.5, 1, 1.5)), (grid, (0, 0, 0))):
        volume = texgs.Volume(data)
        np.testing.assert_array_equal(volume.grid.values, values)
        assert (volume.grid.spacing, volume.grid.origin) == ((1, 2, 3), origin)


def test_mirrored_axes_of_pyvista_are_refused():
    turned = texgs.Volume(field(3, 4, 5)).to_pyvista()
    turned.direction_matrix = [[0, 1, 0], [1, 0, 0], [0, 0, 1]]
    refused(lambda: texgs.Volume(turned), "expected axes that are not mirrored")


@pytest.mark.parametrize(
    ("file", "name"),
    [("big scan.v2.npy", "big_scan"), ("2024.npy", "data"), ("volume.npy", "data"), ("öl.npy", "data")],
)
def test_a_volume_has_the_name_of_its_file_where_a_data_set_can_have_it(tmp_path, file, name):
    np.save(tmp_path / file, field(3, 4, 5))
    assert texgs.Volume(tmp_path / file).name == name
    assert texgs.Volume(str(tmp_path / file), name="mine").name == "mine"
    assert texgs.Volume(field(3, 4, 5)).name == "data"


def test_files_are_opened_and_turned_upright(tmp_path):
    values = field(4, 5, 6)
    first = texgs.Volume(values, folder=tmp_path)
    assert (tmp_path / "volume.nrrd").is_file()
    again = texgs.Volume(first.file, up="+z")
    assert np.array_equal(again.grid.values, values.transpose(1, 0, 2)[::-1])
    assert np.array_equal(open_grid(again.file).values, again.grid.values)


def test_a_channel_of_a_file_has_its_colour_and_window(tmp_path):
    values = np.stack([field(4, 5, 6), 100 * field(4, 5, 6)])
    window = {"window": {"start": 20, "end": 60}}
    said = [{"label": name, "color": color, **window} for name, color in (("a", "FF0000"), ("b", "00FF00"))]
    path = write_image(tmp_path / "v.zarr", [values], axes_of("czyx"), [(1, 3, 2, 1)], labels=said)
    volume = texgs.Volume(path, channel="b")
    assert volume.grid.spacing == (1, 2, 3)
    (tf,) = volume.suggest().values()
    assert tf.opacity[0] == (20, 0)
    assert tf.color[0][1:] == (0, 1, 0)
    assert len(volume.suggest(3)) == 3
    refused(lambda: texgs.Volume(path), r"channel: expected one of 0 \(a\), 1 \(b\), got none")


def test_a_picture_is_what_the_caster_sees_over_the_background():
    volume = texgs.Volume(field(20, 21, 22))
    light, background = np.array([50, 20]), np.array([1, 128 / 255, 0])
    picture = volume.render({"a": RED, "b": BLUE}, 10, 15, 40, 30, light=light, background=background)
    lens = frame_of(volume.grid, [RED, BLUE]).lens(width=40, height=30)
    tf, caster = overlay({"a": RED, "b": BLUE}), Caster(volume.grid, Appearance())
    rgba = caster.cast(tf, orbit(10, 15, *lens), Light("directional", 50, 20)).rgba.double().numpy()
    expected = rgba[..., :3] + (1 - rgba[..., 3:]) * background
    assert np.abs(np.asarray(picture) - 255 * expected.clip(0, 1)).max() <= 0.5001


def test_a_picture_may_have_shadows():
    """Those of a twin with the same functions."""
    volume, light = texgs.Volume(field(20, 21, 22)), {"azimuth": 50, "polar": 20, "shadows": 1, "reach": 0.5}
    functions = {"a": RED, "b": BLUE}
    plain, dark, darker = (
        np.asarray(volume.render(functions, 10, 15, 40, light=light | {"shadows": x, "occlusion": y})) / 255
        for x, y in ((0, 0), (1, 0), (1, 1))
    )
    assert plain.mean() > dark.mean() + 1e-3 > darker.mean() + 2e-3
    entries = {name: SceneModel(Path("x")) for name in functions}
    scene = Scene(entries, light_of(light), volume=SceneVolume(volume.file, functions))
    lens = frame_of(volume.grid, [RED, BLUE]).lens(width=40, height=40)
    expected = Twin(scene).render(orbit(10, 15, *lens), scene, [(0.0, 0.0, 0.0)] * 2).color.numpy()
    assert np.abs(dark - expected.clip(0, 1)).max() <= 0.5001 / 255


def test_suggested_functions_plot_themselves():
    volume = texgs.Volume(field(16, 16, 16))
    functions = volume.suggest(2)
    assert list(functions) == ["TF01", "TF02"]
    assert Image.open(io.BytesIO(functions._repr_png_())).size == (1000, 450)


def test_at_the_end_of_a_cell_there_are_facts_and_a_picture():
    html = texgs.Volume(field(8, 9, 10), name="a<b")._repr_html_()
    assert "10 x 9 x 8" in html
    assert "a&lt;b" in html
    assert "data:image/png;base64," in html
    assert "a<b" not in html


def test_masked_samples_are_missing():
    values = np.ma.masked_greater(field(5, 6, 7), 0.9)
    values.data[values.mask] = 9.96921e36  # netCDF's fill value
    with pytest.raises(ArgumentError, match=r"expected finite samples, got \d+ that are NaN or infinite"):
        texgs.Volume(values)
    kept = texgs.Volume(values, nan_value=np.float64(-1)).grid.values
    assert np.array_equal(kept, values.filled(-1))
    whole = np.ma.masked_array(field(5, 6, 7))  # nothing is masked
    assert np.array_equal(texgs.Volume(whole).grid.values, whole.data)


def test_image_data_that_are_a_part_of_others_keep_their_place():
    image = pyvista.ImageData(dimensions=(5, 6, 7), spacing=(1, 2, 3), origin=(10, 20, 30), offset=(5, 5, 5))
    image.point_data["a"] = field(7, 6, 5).ravel()
    volume = texgs.Volume(image)
    assert volume.grid.origin == (15, 30, 45)


@pytest.mark.parametrize(
    ("data", "keys", "named"),
    [
        (np.zeros((3, 3)), {}, "expected a scalar field .Z, Y, X., got the shape .3, 3."),
        (np.zeros((3, 3, 3), complex), {}, "expected integers, floats or bool, got complex128"),
        (np.full((3, 3, 3), np.nan), {}, "expected finite samples, got 27"),
        (np.ones((4, 4, 4)), {}, "expected a field that varies, but every sample is 1"),
        (1e9 + field(4, 4, 4).astype(float) / 1e3, {}, "expected samples that differ as float32"),
        ([[1, 2], [3]], {}, r"data: expected an array \[Z, Y, X\], got list"),
        (xarray.DataArray(np.zeros((2, 3, 3, 3)), dims=("time", "z", "y", "x")), {}, r"isel\(time=0\)"),
        (
            xarray.DataArray(field(3, 3, 3), dims=("z", "y", "x"), coords={"x": [0, 1, 5]}),
            {},
            "DataArray: expected even distances along x",
        ),
        (xarray.Dataset({"t": (("z", "y", "x"), field(3, 3, 3))}), {}, "one array, got a Dataset of t"),
        (pyvista.Sphere(), {}, r"expected image data .*, got PolyData"),
        (pyvista.MultiBlock(), {}, r"expected image data .*, got MultiBlock"),
        ("no-such-file.nrrd", {}, "no such file or folder"),
        (field(4, 4, 4), {"spacign": 2}, r"spacign: not for arrays, did you mean spacing\?"),
        (field(4, 4, 4), {"name": 3}, "name: "),
        (field(4, 4, 4), {"spacing": 2}, "spacing: "),
        (field(4, 4, 4), {"nan_value": "0"}, "nan_value: "),
        (field(4, 4, 4), {"crop": (0, 4 / 2, 0, 4, 0, 4)}, "crop: "),
        (field(4, 4, 4), {"up": "z"}, "up: "),
        (field(4, 4, 4), {"up": ["+y"]}, "up: "),
        (field(4, 4, 4), {"reduce": 0}, "reduce: "),
        (field(4, 4, 4), {"method": "max"}, "method: "),
        ("a.raw", {"dims": 512, "dtype": "uint8"}, "dims: "),
        ("a.raw", {"dims": (2, 2, 2), "skip": "16"}, "skip: "),
        ("a.nii", {"time": "0"}, "time: "),
        ("a.txt", {"dims": (2, 2, 2), "column": 0}, "column: "),
    ],
)
def test_what_is_no_volume_names_what_is_wrong(data, keys, named):
    refused(lambda: texgs.Volume(data, **keys), named, (ArgumentError, ShapeError))


@pytest.mark.parametrize(
    ("slip", "named"),
    [
        (lambda volume: volume.suggest(0), "count: "),
        (lambda volume: volume.suggest("2"), "count: "),
        (lambda volume: volume.render([]), "functions: expected at least one"),
        (lambda volume: volume.render(["red"]), "TF01: expected a texgs.TransferFunction, got str"),
        (lambda volume: volume.render("quick"), r"functions: expected one .* got 'quick'"),
        (lambda volume: volume.render(RED, light="sun"), "light: "),
        (lambda volume: volume.render(RED, width=0), "width: "),
    ],
)
def test_a_slip_names_its_argument(slip, named):
    refused(lambda: slip(texgs.Volume(field(8, 8, 8))), named)


def test_numbers_of_numpy_are_sizes_and_a_number_is_a_series(tmp_path):
    (raw := tmp_path / "a.raw").write_bytes(field(4, 3, 2).astype("<f4").tobytes())
    assert texgs.Volume(raw, dims=np.array([2, 3, 4]), dtype="float32").grid.dims == (2, 3, 4)
    (tmp_path / "slices").mkdir()
    write_series(tmp_path / "slices", np.int16(1000 * field(4, 5, 6)), number=2)
    write_series(tmp_path / "slices", np.int16(1000 * field(4, 5, 7)), number=3, uid=generate_uid())
    assert texgs.Volume(tmp_path / "slices", series=2, up="+y").grid.dims[0] == 6


def test_a_volume_is_cropped_and_reduced():
    values = field(8, 8, 8)
    volume = texgs.Volume(values, crop=(0, 8, 0, 8, 2, 6), reduce=2)
    wanted = values[2:6].reshape(2, 2, 4, 2, 4, 2).mean(axis=(1, 3, 5))
    assert np.allclose(volume.grid.values, wanted)
    assert np.array_equal(
        texgs.Volume(values, reduce=2, method="sample").grid.values, values[1::2, 1::2, 1::2]
    )


def test_a_folder_holds_one_volume(tmp_path):
    one = texgs.Volume(field(4, 5, 6), folder=tmp_path)
    again = texgs.Volume(field(4, 5, 6), folder=tmp_path)
    assert np.array_equal(one.grid.values, again.grid.values)
    for other, keys in ((field(4, 5, 7), {}), (one.file, {"up": "+z"})):
        with pytest.raises(
            ArgumentError, match=r"folder: expected one without another volume, got .*volume.nrrd"
        ):
            texgs.Volume(other, folder=tmp_path, **keys)
    assert np.array_equal(open_grid(one.file).values, field(4, 5, 6))
    assert sorted(file.name for file in tmp_path.iterdir()) == ["volume.json", "volume.nrrd"]
    refused(lambda: texgs.Volume(field(4, 4, 4), folder=one.file), "folder: .* cannot be made")


def test_what_a_file_leaves_open_is_told(tmp_path):
    image = pyvista.ImageData(dimensions=(5, 6, 7))
    image.point_data["p"], image.point_data["q"] = field(7, 6, 5).ravel(), 2 * field(7, 6, 5).ravel()
    image.save(tmp_path / "two.vti")
    with pytest.warns(UserWarning, match=r"^two: array .; variable chooses another \(.\)$"):
        texgs.Volume(tmp_path / "two.vti")
    volume = texgs.Volume(tmp_path / "two.vti", variable="q")
    assert np.array_equal(volume.grid.values, 2 * field(7, 6, 5))
