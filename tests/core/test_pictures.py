"""Pictures, grids of pictures, and films."""

import numpy as np
import pytest
import torch
from PIL import Image, ImageSequence

from tests.refusals import refused
from texgs.core.errors import ShapeError
from texgs.core.figures import CELL, DPI, FOOT, GAP, HEAD, LEFT, content, write_grid
from texgs.core.image import read_rgba, to_pillow, write_png
from texgs.core.movie import write_frames


@pytest.mark.parametrize(
    ("colors", "alphas", "pixels"),
    [
        ([[0.0, 0.5, 1.0], [-0.2, 1.7, 0.501]], None, [(0, 128, 255), (0, 255, 128)]),
        ([[0.25, 0.5, 0.0], [0.0, 0.0, 0.0]], [[0.5, 0.0]], [(128, 255, 0, 128), (0, 0, 0, 0)]),
    ],
)
def test_values_are_rounded_and_clamped_and_of_straight_alpha(tmp_path, colors, alphas, pixels):
    write_png(tmp_path / "x.png", torch.tensor([colors]), None if alphas is None else torch.tensor(alphas))
    with Image.open(tmp_path / "x.png") as picture:
        assert picture.mode == ("RGB" if alphas is None else "RGBA")
        assert [picture.getpixel((x, 0)) for x in range(2)] == pixels


def test_round_trip_is_within_rounding(tmp_path):
    generator = torch.Generator().manual_seed(0)
    alpha = torch.rand(9, 7, generator=generator)
    color = torch.rand(9, 7, 3, generator=generator) * alpha[..., None]
    write_png(tmp_path / "x.png", color, alpha)
    straight = torch.from_numpy(read_rgba(tmp_path / "x.png")) / 255
    color_read, alpha_read = straight[..., :3] * straight[..., 3:], straight[..., 3]
    # Half a level of the straight colour and half a level of alpha.
    torch.testing.assert_close(color_read, color, atol=1.01 / 255, rtol=0)
    torch.testing.assert_close(alpha_read, alpha, atol=0.51 / 255, rtol=0)


def test_grey_of_16_bits_is_rounded(tmp_path):
    Image.fromarray(np.array([[0, 257 * 100, 65535]], dtype=np.uint16)).save(tmp_path / "x.png")
    assert read_rgba(tmp_path / "x.png")[0].tolist() == [[0, 0, 0, 255], [100, 100, 100, 255], [255] * 4]


def test_one_channel_is_grey():
    assert to_pillow(torch.ones(2, 2, 1)).mode == "L"
    assert to_pillow(torch.ones(2, 2, 1), torch.ones(2, 2)).mode == "RGBA"


def test_mistakes_are_named(tmp_path):
    refused(lambda: to_pillow(torch.zeros(3, 2, 2)), "color: ", ShapeError)
    refused(lambda: to_pillow(torch.zeros(2, 2, 3), torch.zeros(2, 3)), "alpha: ", ShapeError)
    refused(lambda: to_pillow(torch.full((1, 1, 3), float("nan"))), "color: .*finite")
    refused(lambda: read_rgba(tmp_path / "none.png"), "no such file")


def picture(rows, columns, size=(60, 80), value=0.2):
    """White with a grey block."""
    pixels = np.ones((*size, 3))
    pixels[rows, columns] = value
    return pixels


BLOCK = picture(slice(20, 30), slice(30, 40))


def test_a_row_for_each_name_and_a_column_for_each_title(tmp_path):
    rows = dict.fromkeys(("scene", "volume"), [BLOCK] * 3)
    path = write_grid(tmp_path / "a.png", rows, ["one", "two", "three"])
    width, height = Image.open(path).size
    assert width == round((LEFT + 3 * (CELL + GAP)) * DPI)
    assert height == round((GAP + HEAD + 2 * (CELL + GAP)) * DPI)
    again = write_grid(tmp_path / "b.png", rows, ["one", "two", "three"])
    assert path.read_bytes() == again.read_bytes()


def test_all_show_the_square_around_what_any_shows():
    pictures = [picture(slice(20, 24), slice(30, 34)), picture(slice(26, 30), slice(50, 54))]
    rows, columns = content(pictures)
    assert rows.stop - rows.start == columns.stop - columns.start == 24 + 8
    assert rows.start < 20 < 30 < rows.stop
    assert columns.start <= 30 < 54 <= columns.stop
    assert content([np.ones((4, 4, 3))]) == (slice(None), slice(None))


def test_places_may_be_empty_and_pictures_have_words_below(tmp_path):
    rows, titles = {"a": [BLOCK, None], "b": [None, BLOCK]}, ["one", "two"]
    plain = write_grid(tmp_path / "plain.png", rows, titles)
    noted = write_grid(tmp_path / "noted.png", rows, titles, {"a": ["", ""], "b": ["", "31.2 dB"]})
    (width, height), (_, higher) = Image.open(plain).size, Image.open(noted).size
    assert higher - height == round((FOOT - GAP) * DPI)
    pixels = np.asarray(Image.open(plain).convert("L"))
    right = pixels[70 : height // 2 - 20, width // 2 + 20 :]
    assert right.min() == 255, "nothing is drawn in the empty place"
    assert pixels[70 : height // 2 - 20, 20 : width // 2 - 20].min() < 100
    refused(lambda: write_grid(tmp_path / "a.png", rows, ["one", "two", "three"]), "a: .*3 pictures, got 2")


def frames(count=4, height=33, width=47):
    """Frames of one grey each, brighter by 40 from one to the next."""
    return [np.full((height, width, 3), 40 * (i + 1), dtype=np.uint8) for i in range(count)]


def test_one_picture_and_a_folder_of_pictures_that_is_never_another_films(tmp_path):
    picture = np.random.default_rng(0).integers(0, 256, (5, 7, 3), dtype=np.uint8)
    path = write_frames(tmp_path / "new" / "a.png", [picture])
    assert np.array_equal(np.asarray(Image.open(path)), picture)
    write_frames(tmp_path / "turn", iter(frames(3)))
    paths = sorted((tmp_path / "turn").iterdir())
    assert [path.name for path in paths] == ["0000.png", "0001.png", "0002.png"]
    assert np.asarray(Image.open(paths[2]))[0, 0, 0] == 120
    before = [path.read_bytes() for path in paths]
    refused(lambda: write_frames(tmp_path / "turn", frames(2)), "numbered pictures, got 0000")
    assert [path.read_bytes() for path in sorted((tmp_path / "turn").iterdir())] == before
    paths[0].unlink()
    refused(lambda: write_frames(tmp_path / "turn", frames(2)), "numbered pictures, got 0001")


@pytest.mark.parametrize("name", ["a.png", "a.gif", "a.mp4", "a", "deep/er/a"])
def test_where_nothing_can_be_written_nothing_is_rendered(tmp_path, monkeypatch, name):
    def rendered():
        pytest.fail("a frame was rendered")
        yield

    (tmp_path / "file").touch()
    refused(lambda: write_frames(tmp_path / "file" / name, rendered()), f"file/{name}.*Not a directory")
    monkeypatch.setattr("os.access", lambda *_: False)  # as for others than root
    refused(lambda: write_frames(tmp_path / name, rendered()), f"{name}.*Permission denied")


@pytest.mark.parametrize("fps", [15, 24, 30, 40, 50])
def test_a_gif_takes_as_long_as_it_should(tmp_path, fps):
    """It counts in hundredths of a second, of which a frame may not have a whole number."""
    grey = [np.full((8, 8, 3), index, dtype=np.uint8) for index in range(fps)]
    with Image.open(write_frames(tmp_path / "a.gif", grey, fps=fps)) as gif:
        assert sum(frame.info["duration"] for frame in ImageSequence.Iterator(gif)) == 1000


def test_gif_and_mp4_hold_the_frames_at_their_rate(tmp_path):
    av = pytest.importorskip("av")
    write_frames(tmp_path / "a.gif", frames(), fps=20)
    with Image.open(tmp_path / "a.gif") as gif:
        shown = [np.asarray(frame.convert("RGB"))[5, 5, 0] for frame in ImageSequence.Iterator(gif)]
        assert gif.info["duration"] == 50
    assert shown == [40, 80, 120, 160]
    write_frames(tmp_path / "a.mp4", frames(), fps=20)
    with av.open(str(tmp_path / "a.mp4")) as film:
        stream = film.streams.video[0]
        decoded = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
        assert float(stream.average_rate) == 20
    assert [frame.shape for frame in decoded] == [(34, 48, 3)] * 4, "sizes of films are even"
    assert np.allclose([frame.mean() for frame in decoded], [40, 80, 120, 160], atol=4)
    write_frames(tmp_path / "b.mp4", frames(), fps=2.5)
    with av.open(str(tmp_path / "b.mp4")) as film:
        assert float(film.streams.video[0].average_rate) == 2.5
    refused(lambda: write_frames(tmp_path / "c.mp4", frames(2, 16, 17000)), "17000 x 16 pixels")
    assert not (tmp_path / "c.mp4").exists()


@pytest.mark.parametrize(
    ("name", "given", "fps", "named"),
    [
        *(("a.gif", 2, fps, f"fps: .*{fps}; write an MP4") for fps in (51, 0.001)),
        ("a.avi", 2, 25, r"\.avi"),
        ("a.png", 2, 25, "one frame"),
        ("a.mp4", 0, 25, "at least one frame"),
        ("a.mp4", 2, 0, "fps: "),
    ],
)
def test_what_cannot_be_written(tmp_path, name, given, fps, named):
    refused(lambda: write_frames(tmp_path / name, frames(given), fps), named)
    assert list(tmp_path.iterdir()) == []


def test_a_higher_rate_factor_makes_a_smaller_film(tmp_path):
    noise = np.random.default_rng(0).integers(0, 256, (2, 64, 64, 3), dtype=np.uint8)
    fine, coarse = (write_frames(tmp_path / f"{crf}.mp4", noise, crf=crf) for crf in (18, 35))
    assert coarse.stat().st_size < 0.5 * fine.stat().st_size


def test_pictures_of_a_film_that_is_interrupted_are_gone(tmp_path):
    """The same command starts again."""

    def broken():
        yield np.zeros((4, 4, 3), np.uint8)
        raise KeyboardInterrupt

    (tmp_path / "film").mkdir()
    (tmp_path / "film" / "notes.txt").write_text("mine")
    with pytest.raises(KeyboardInterrupt):
        write_frames(tmp_path / "film", broken())
    assert [file.name for file in (tmp_path / "film").iterdir()] == ["notes.txt"]
