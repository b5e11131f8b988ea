import numpy as np
import pytest
from PIL import Image, ImageSequence

from tests.refusals import refused
from texgs.core.movie import write_frames


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
