"""The folder of a result: what survives failures and kills, what counts as damaged, what is refused."""

import json
import os
import shutil
import time
from threading import Event, Thread

import pytest

from tests.refusals import refused
from texgs.core.cache import Checksums
from texgs.core.io import read_json, write_bytes, write_json
from texgs.workflow import result
from texgs.workflow.notes import note_written

MINE, OTHER = {"stage": "views", "settings": "a"}, {"stage": "views", "settings": "b"}


@pytest.fixture
def output(tmp_path):
    return tmp_path / "TF01" / "views"


def make(output, identity=MINE, content="one"):
    """The complete result of a job, with a file in a folder of its own."""
    work = result.claim(output, identity)
    (work / "train").mkdir(exist_ok=True)
    (work / "train" / "r.png").write_text(content)
    write_json(work / result.METRICS, {"seconds": time.perf_counter()})
    result.publish(output)


def files(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()
    }


def test_a_result_is_complete_with_all_its_files_as_they_were(output):
    assert not result.is_complete(output, Checksums())
    make(output)
    assert result.is_complete(output, Checksums())
    assert set(read_json(output / result.FILES)) == {"train/r.png", result.METRICS}
    assert [path.name for path in output.parent.iterdir()] == ["views"]
    (output / "train" / "r.png").write_text("One")
    assert not result.is_complete(output, Checksums())
    assert result.damaged_files(output, None) == ["train/r.png"]
    (output / "train" / "r.png").write_text("one")
    assert result.is_complete(output, Checksums())
    (output / "train" / "r.png").unlink()
    assert result.damaged_files(output, None) == ["train/r.png"]


@pytest.mark.parametrize("damage", [None, "[1]", '{"train/r.p'])
def test_a_result_whose_list_of_files_cannot_be_read_is_not_replaced(output, damage):
    make(output)
    (output / "notes.txt").write_text("mine")
    (output / result.FILES).unlink() if damage is None else (output / result.FILES).write_text(damage)
    assert not result.is_complete(output, Checksums())
    assert result.file_checksums(output) == {}
    for identity in (MINE, OTHER):
        refused(
            lambda identity=identity: result.claim(output, identity), r"views/\.files\.json: cannot be read"
        )
    assert (output / "notes.txt").read_text() == "mine"


def test_a_damaged_stamp_is_of_no_job(output):
    make(output)
    (output / result.STAMP).write_text('{"stage": "vie')
    assert result.stamp_of(output) is None
    make(output, content="two")
    assert result.is_complete(output, Checksums())
    assert result.stamp_of(output) == MINE


def test_the_result_before_stays_until_there_is_a_better_one(output):
    make(output)
    before = files(output)
    work = result.claim(output, OTHER)
    (work / "half.png").write_text("half")
    assert files(output) == before
    make(output, OTHER, "two")
    assert (output / "train" / "r.png").read_text() == "two"
    assert result.stamp_of(output) == OTHER


def test_an_interrupted_run_goes_on_and_that_of_another_job_does_not(output):
    work = result.claim(output, MINE)
    (work / "half.png").write_text("half")
    (work / ".model.safetensors.ab12cd_8").write_text("of write_atomic, killed")
    assert sorted(files(result.claim(output, MINE))) == [result.STAMP, "half.png"]
    assert sorted(files(result.claim(output, OTHER))) == [result.STAMP]


def test_a_damaged_result_is_where_its_repair_begins(output):
    work = result.claim(output, MINE)
    (work / "good.png").write_text("good")
    make(output)
    (output / "train" / "r.png").write_text("damaged")
    assert sorted(files(result.claim(output, MINE))) == [result.STAMP, "good.png"]


def test_a_job_that_is_to_begin_anew_takes_nothing_and_keeps_the_result_until_it_is_done(output):
    make(output)
    before = files(output)
    (result.claim(output, OTHER) / "half.png").write_text("half")
    for _ in range(2):
        work = result.claim(output, MINE, is_fresh=True)
        assert sorted(files(work)) == [result.STAMP]
        assert files(output) == before
        (work / "half.png").write_text("half")


@pytest.mark.parametrize("killed_after", ["the first rename", "the second"])
def test_a_swap_that_was_killed_is_finished(output, killed_after):
    make(output, OTHER, "old")
    result.claim(output, MINE)
    make_beside = output.with_name("other")
    make(make_beside, MINE, "new")
    work, old = result.work_folder(output), output.with_name(".views.old")
    shutil.rmtree(work)
    output.rename(old)
    make_beside.rename(work if killed_after == "the first rename" else output)
    result.recover(output)
    assert (output / "train" / "r.png").read_text() == "new"
    assert result.is_complete(output, Checksums())
    assert not old.exists()


def test_a_killed_swap_without_a_complete_new_result_brings_the_old_one_back(output):
    make(output, OTHER, "old")
    output.rename(output.with_name(".views.old"))
    output.mkdir()  # as Snakemake does before a job
    result.recover(output)
    assert (output / "train" / "r.png").read_text() == "old"


@pytest.mark.parametrize("name", ["train/mine.txt", "notes/a.md"])
def test_files_of_the_user_are_never_lost(output, name):
    make(output)
    (output / name).parent.mkdir(exist_ok=True)
    (output / name).write_text("mine")
    for identity in (MINE, OTHER):
        refused(lambda identity=identity: result.claim(output, identity), rf"the folder also holds {name};")
    assert (output / name).read_text() == "mine"


def test_files_that_the_user_puts_there_while_the_job_works_are_not_lost(output):
    make(output)
    work = result.claim(output, OTHER)
    write_json(work / result.METRICS, {})
    (output / "mine.yaml").write_text("mine")
    refused(lambda: result.publish(output), "the folder also holds mine.yaml; move what is yours away")
    (output / "mine.yaml").rename(output.with_name("mine.yaml"))
    assert result.claim(output, OTHER) == work
    result.publish(output)
    assert result.stamp_of(output) == OTHER


def test_a_folder_of_others_or_a_link_is_refused(output):
    output.mkdir(parents=True)
    (output / "thesis.tex").touch()
    refused(lambda: result.claim(output, MINE), "expected an empty folder or one of texgs")
    link, file = output.with_name("link"), output.with_name("file")
    link.symlink_to(output)
    file.write_text("mine")
    for other in (link, file):
        result.recover(other)
        refused(lambda other=other: result.claim(other, MINE), "expected a folder, got a link or a file")


def test_fingerprints_know_contents_and_makers_but_no_times(output, tmp_path):
    def of(path):
        return result.fingerprint(path, Checksums())

    make(output)
    first = of(output / "transforms_train.json")
    make(output)
    assert of(output / "transforms_train.json") == first, "only metrics.json differs"
    make(output, OTHER)
    assert of(output / "transforms_train.json") != first, "the same bytes, by another job"
    make(output, MINE, "two")
    assert of(output / "transforms_train.json") != first
    volume = tmp_path / "ct.raw"
    volume.write_bytes(b"12")
    alone = of(volume)
    os.utime(volume, ns=(1, 1))
    assert of(volume) == alone
    volume.write_bytes(b"13")
    assert of(volume) != alone


def is_told(path, other, text):
    """Whether the fingerprint of an input knows of the contents of another file."""
    before = result.fingerprint(path, Checksums())
    other.write_text(text)
    return result.fingerprint(path, Checksums()) != before


def test_fingerprints_of_views_from_elsewhere_and_of_slices_know_all_that_jobs_read(tmp_path, output):
    (tmp_path / "train").mkdir()
    (views := tmp_path / "transforms_train.json").write_text("{}")
    assert is_told(views, tmp_path / "train" / "r_0.png", "one")
    assert is_told(views, tmp_path / "train" / "r_0.png", "two")
    assert is_told(views, tmp_path / "points3d.ply", "where surfels start")
    assert not is_told(views, tmp_path / "notes.txt", "mine")
    (own := tmp_path / "own").mkdir()
    named = [{"file_path": "../train/r_0"}, {"file_path": str(tmp_path / "r_1.png")}, {"file_path": 3}, {}]
    (elsewhere := own / "transforms_train.json").write_text(json.dumps({"frames": named[:2]}))
    assert is_told(elsewhere, tmp_path / "train" / "r_0.png", "three")
    assert is_told(elsewhere, tmp_path / "r_1.png", "one")
    assert not is_told(elsewhere, tmp_path / "train" / "r_2.png", "of others")
    elsewhere.write_text(json.dumps({"frames": named}))
    assert result.fingerprint(elsewhere, Checksums())
    (slices := tmp_path / "slices").mkdir()
    (slices / "z1.tif").write_text("one")
    assert is_told(slices, slices / "z1.tif", "two")
    assert is_told(slices, slices / "z2.TIFF", "more")
    assert not is_told(slices, slices / ".DS_Store", "of the system")
    (chunks := tmp_path / "v.zarr" / "0" / "c").mkdir(parents=True)
    assert is_told(tmp_path / "v.zarr", chunks / "0", "a chunk")
    make(output)
    (output / "mine.yaml").write_text("one")
    assert is_told(output / "mine.yaml", output / "mine.yaml", "two"), "a file beside a result is its own"


@pytest.mark.parametrize(
    ("name", "header"),
    [("a.mhd", "NDims = 3\nElementDataFile = a.raw\n"), ("a.nhdr", "NRRD0004\ndata file: a.raw\n")],
)
def test_fingerprints_of_headers_know_their_samples(tmp_path, name, header):
    (tmp_path / name).write_text(header)
    (tmp_path / "a.raw").write_text("one")
    assert is_told(tmp_path / name, tmp_path / "a.raw", "two")
    (tmp_path / name).unlink()
    refused(lambda: result.fingerprint(tmp_path / name, Checksums()), r"a\.")


def test_a_damaged_input_names_its_maker_and_is_looked_at_anew(output, monkeypatch, tmp_path):
    monkeypatch.setenv("TEXGS_CACHE", str(tmp_path / "cache"))
    make(output)
    image = output / "train" / "r.png"
    known = Checksums.load()
    assert result.is_complete(output, known)
    known.save()
    status = image.stat()
    image.write_text("eno")  # the same size ...
    os.utime(image, ns=(status.st_atime_ns, status.st_mtime_ns))  # ... and time, as where a disk fails
    assert result.is_complete(output, Checksums.load()), "this is what checksums of starting jobs are for"
    file = output / "transforms_train.json"
    refused(lambda: result.require_intact(file), r"r\.png: missing or damaged since views made it; run the")
    assert not result.is_complete(output, Checksums.load())


def hold(output, seconds, started):
    """What a job does; a lock is of an opened file, not of a process."""
    with result.alone(output):
        started.set()
        time.sleep(seconds)


def test_two_jobs_do_not_work_in_one_folder(output, capsys):
    started = Event()
    other = Thread(target=hold, args=(output, 1.0, started))
    other.start()
    assert started.wait(60)
    begin = time.monotonic()
    with result.alone(output):
        waited = time.monotonic() - begin
    other.join()
    assert waited > 0.5
    assert "another job works there; waiting for it to end" in capsys.readouterr().err


def test_two_runs_do_not_share_results(tmp_path):
    lock = result.run_alone(str(tmp_path))
    refused(lambda: result.run_alone(str(tmp_path)), "another run works there; wait for it to end")
    lock.release()
    result.run_alone(str(tmp_path)).release()


def test_a_run_that_only_touches_files_notes_those_that_are_there(tmp_path):
    made = [write_bytes(tmp_path / "tables" / "fits.csv", b"a\n"), tmp_path / "report.html"]
    note_written(str(tmp_path), map(str, made))
    assert [*read_json(tmp_path / ".conf" / "written.json")["value"]] == [str(made[0])]
