"""Real files of every kind against what is known of them, and against other readers."""

import json

import numpy as np
import pytest

from tests.real_data import FOLDER, real_data
from texgs.volume.nrrd_file import open_grid
from texgs.volume.prepare import prepare
from texgs.volume.sources import open_source

MANIFEST = FOLDER / "volumes" / "manifest.json"
ENTRIES = json.loads(MANIFEST.read_text()) if MANIFEST.exists() else []
VOLUMES = [entry for entry in ENTRIES if not entry["file"].endswith(".zraw")]


@pytest.mark.skipif(not VOLUMES, reason=f"no {MANIFEST.name} of real volumes; set TEXGS_TEST_DATA")
@pytest.mark.parametrize("entry", VOLUMES, ids=lambda entry: entry["file"])
def test_volume_is_as_its_manifest_says(tmp_path, capfd, entry):
    source = open_source(real_data(f"volumes/{entry['file']}"))
    assert (source.dims, source.dtype) == (tuple(entry["dims_xyz"]), entry["dtype"])
    assert source.spacing == pytest.approx(entry["spacing_xyz"], rel=1e-6)  # NIfTI stores float32
    summary = prepare(source, tmp_path / "v.nrrd")
    assert (summary.minimum, summary.maximum) == (entry["min"], entry["max"])
    assert sum(summary.histogram) == summary.voxels == np.prod(source.dims)
    middle = source.dims[2] // 2
    written = open_grid(tmp_path / "v.nrrd").values[middle]
    np.testing.assert_array_equal(written, source.slices(middle, middle + 1)[0])
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "n_slices"),
    [
        ("neghip.slc", 66),
        ("tooth.nrrd", 161),
        # The header's CompressedDataSize is too small: VTK stops there, and fills the rest with 0.
        ("frog.mhd", 131),
        ("mni152.nii.gz", 189),
        ("heptane.nii.gz", 302),
        ("bonsai.vti", 256),
    ],
)
def test_agrees_with_pyvista(name, n_slices):
    pyvista = pytest.importorskip("pyvista")
    path = real_data(f"volumes/{name}")
    image = pyvista.read(path)
    source = open_source(path)
    assert (source.dims, source.spacing) == (image.dimensions, pytest.approx(image.spacing))
    values = np.asarray(image.point_data.active_scalars).reshape(source.dims[::-1])
    np.testing.assert_array_equal(source.slices(0, n_slices), values[:n_slices])


def test_tiff_agrees_with_pillow():
    from PIL import Image

    path = real_data("volumes/fly.tif")
    source = open_source(path)
    with Image.open(path) as picture:
        for z in (0, 77, 149):
            picture.seek(z)
            np.testing.assert_array_equal(source.slices(z, z + 1)[0], np.asarray(picture))
