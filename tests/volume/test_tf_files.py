import colorsys
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
from vtkmodules.vtkRenderingCore import vtkColorTransferFunction

from texgs.core.errors import ArgumentError
from texgs.volume.tf_files import read_tf, write_paraview
from texgs.volume.transfer import TransferFunction

TENT = TransferFunction(
    opacity=((1, 0.2), (2, 0.8), (2, 0.1), (4, 0.3)), color=((0, 1, 0, 0), (1.5, 0, 1, 0), (1.5, 0, 0, 1))
)
RAMP = [0, 0, 0.5, 0, 1, 1, 0.5, 0]
RED_TO_BLUE = [0, 1, 0, 0, 1, 0, 0, 1]
OFF_STEPS = np.array([-1, 0.5, 1, 1.2, 1.7, 1.99, 2, 3, 4, 9])


def preset(tmp_path, **entries):
    path = tmp_path / "preset.json"
    path.write_text(json.dumps([{"Name": "mine", "RGBPoints": RED_TO_BLUE, **entries}]))
    return path


def test_our_file_has_the_points_as_they_are(tmp_path):
    path = tmp_path / "tf.json"
    path.write_text(json.dumps({"format": "texgs-tf", "version": 1, **TENT.to_dict()}))
    assert read_tf(path) == TENT


class TestParaView:
    def test_what_is_written_is_what_is_read(self, tmp_path):
        path = write_paraview(tmp_path / "tf.json", TENT, "bones")
        np.testing.assert_allclose(read_tf(path)(OFF_STEPS), TENT(OFF_STEPS), atol=1e-4)

    def test_written_points_span_one_range_and_end_transparent(self, tmp_path):
        (entry,) = json.loads(write_paraview(tmp_path / "tf.json", TENT, "bones").read_text())
        color, opacity = np.reshape(entry["RGBPoints"], (-1, 4)), np.reshape(entry["Points"], (-1, 4))
        assert color[0, 0] == opacity[0, 0] == 0
        assert color[-1, 0] == opacity[-1, 0] == pytest.approx(4, abs=1e-4)
        assert opacity[0, 1] == opacity[-1, 1] == 0
        assert (opacity[:, 2:] == [0.5, 0]).all()
        assert entry["ColorSpace"] == "RGB"

    def test_linear_presets_are_exact(self, tmp_path):
        points = [4, 1, 0.5, 0, 2, 0, 0.5, 0]
        tf = read_tf(preset(tmp_path, Points=points, ColorSpace="RGB", NanColor=[1, 1, 0]))
        assert tf.opacity == ((2, 0), (4, 1))
        assert tf.color == ((0, 1, 0, 0), (1, 0, 0, 1))
        assert read_tf(preset(tmp_path)).opacity == ((0, 0), (1, 1)), "ParaView's ramp"

    def test_hsv_follows_the_hue(self, tmp_path):
        tf = read_tf(preset(tmp_path, ColorSpace="HSV", RGBPoints=[0, 1, 0, 0, 1, 0, 0.5, 1]))
        t = np.linspace(0, 1, 57)
        expected = [colorsys.hsv_to_rgb(x * 210 / 360, 1, 1) for x in t]
        np.testing.assert_allclose(tf(t)[:, :3], expected, atol=0.02)

    @pytest.mark.parametrize("space", ["Lab", "Diverging", "Lab/CIEDE2000"])
    def test_other_spaces_agree_with_vtk(self, tmp_path, space):
        function = vtkColorTransferFunction()
        getattr(function, f"SetColorSpaceTo{space.replace('/', '')}")()
        points = [0, 0.23, 0.3, 0.75, 1, 0.71, 0.02, 0.15]
        function.AddRGBPoint(*points[:4])
        function.AddRGBPoint(*points[4:])
        tf = read_tf(preset(tmp_path, ColorSpace=space, RGBPoints=points))
        t = np.linspace(0.02, 0.98, 12)
        np.testing.assert_allclose(tf(t)[:, :3], [function.GetColor(x) for x in t], atol=2 / 255)

    def test_steps_of_color_are_steps(self, tmp_path):
        points = [0, 1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1]
        tf = read_tf(preset(tmp_path, ColorSpace="Step", RGBPoints=points))
        np.testing.assert_allclose(tf([0.01, 0.99])[:, :3], [[0, 1, 0], [0, 1, 0]], atol=1e-9)
        np.testing.assert_allclose(tf([1.01, 1.99])[:, :3], [[0, 0, 1], [0, 0, 1]], atol=1e-9)

    def test_a_step_within_another_space_stays_one(self, tmp_path):
        points = [0, 0, 0, 0.35, 0.5, 0.99, 0.96, 0.9, 0.5, 0.94, 0.98, 0.99, 1, 0.35, 0.07, 0.21]
        tf = read_tf(preset(tmp_path, ColorSpace="Lab", RGBPoints=points))
        np.testing.assert_allclose(tf([0.5 - 1e-9, 0.5])[:, 2], [0.9, 0.99], atol=1e-4)

    def test_a_fine_table_is_taken_as_it_is(self, tmp_path):
        points = [x for i in range(64) for x in (i, i / 63, 0.5, 1 - i / 63)]
        assert len(read_tf(preset(tmp_path, ColorSpace="Diverging", RGBPoints=points)).color) == 64

    @given(middle=st.floats(0.1, 0.9), sharpness=st.floats(0, 1))
    def test_midpoint_and_sharpness_agree_with_vtk(self, tmp_path_factory, middle, sharpness):
        function, points = vtkPiecewiseFunction(), [0, 0.1, middle, sharpness, 2, 0.9, 0.5, 0]
        function.AddPoint(*points[:4])
        function.AddPoint(*points[4:])
        path = preset(tmp_path_factory.getbasetemp(), Points=points)
        t = np.linspace(0, 2, 41)
        np.testing.assert_allclose(read_tf(path)(t)[:, 3], [function.GetValue(x) for x in t], atol=0.02)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "expected JSON"),
        ("[]", 'expected a transfer function with "format": "texgs-tf" or a list of ParaView presets'),
        ('{"a": 1}', "got neither; export it from ParaView, or take a"),
        ('["RGBPoints"]', "got neither"),
        ('{"format": "texgs-tf", "version": 2}', "version: expected 1, got 2; update texgs"),
        ('{"format": "texgs-tf", "version": 1, "opacity": []}', "expected the keys opacity, color"),
        ('{"format": "texgs-tf", "version": 1, "opacity": [[0]], "color": []}', "opacity: expected at least"),
        ('[{"Name": "x", "IndexedColors": [1, 1, 1]}]', "preset 'x': expected RGBPoints, got a categorical"),
        (
            '[{"Name": "a", "RGBPoints": []}, {"Name": "b", "RGBPoints": []}]',
            "one preset, got 2: a, b; export",
        ),
        ('[{"RGBPoints": [0, 0, 0]}]', "RGBPoints: expected four numbers per point, got 3 numbers"),
        ('[{"RGBPoints": [0, 0, 0, "x"]}]', "RGBPoints: expected a list of numbers"),
        (
            '[{"RGBPoints": [0, 1e19, 0, 0, 1, 0, 0, 1], "ColorSpace": "Diverging"}]',
            r"RGBPoints: expected r, g, b in \[0, 1\]",
        ),
        ('[{"RGBPoints": [0, 0, 0, 0], "ColorSpace": "CMYK"}]', "ColorSpace: expected one of RGB, HSV"),
    ],
)
def test_a_wrong_file_is_named_with_its_mistake(tmp_path, content, message):
    path = tmp_path / "wrong.json"
    path.write_text(content)
    with pytest.raises(ArgumentError, match=rf"wrong\.json: .*{message}"):
        read_tf(path)
    with pytest.raises(ArgumentError, match=r"none\.json: no such file"):
        read_tf(tmp_path / "none.json")
