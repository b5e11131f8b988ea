"""`texgs view`: where it listens, what it says, and that it ends."""

import io
import os
import re
import signal
import socket
import subprocess
import sys
import urllib.request

import pytest

from tests.viewer.conftest import scene_file  # noqa: F401
from texgs.cli import view
from texgs.cli.main import main
from texgs.core.errors import ArgumentError
from texgs.scene.scene_file import read_scene
from texgs.viewer.messages import Edit
from texgs.viewer.server import Server
from texgs.viewer.shared_edits import open_scene


def test_it_serves_until_it_is_interrupted(scene_file, tmp_path):  # noqa: F811
    words = [sys.executable, "-m", "texgs.cli.main", "view", str(scene_file), "--no-browser", "--port", "0"]
    env = {**os.environ, "TEXGS_CACHE": str(tmp_path / "cache")}
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=env)
    address = process.stdout.readline().strip()
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{43}/", address)
    with urllib.request.urlopen(address) as answer:
        assert b"<title>texgs</title>" in answer.read()
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=60)[1] == ""
    assert process.returncode == 0


def test_a_port_that_is_taken(monkeypatch):
    with socket.create_server((view.HOST, 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ArgumentError, match=f"--port: cannot listen on port {port} of 127.0.0.1"):
            view.listen(view.HOST, port)
        monkeypatch.setattr(view, "PORT", port)
        with view.listen(view.HOST, None) as other:
            assert other.getsockname()[1] != port


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--port", "70000"], "--port: expected 0 to 65535, got 70000"),
        (["--host", "a..b"], "--host: expected a name or an address of this machine, got a..b"),
        (["--host", "none.invalid"], "--host: expected a name or an address of this machine, got none"),
    ],
)
def test_what_cannot_be_listened_on_is_told(scene_file, capsys, words, message):  # noqa: F811
    assert main(["view", str(scene_file), "--no-browser", *words]) == 2
    assert message in capsys.readouterr().err


def test_a_damaged_model_is_told_before_anything_is_served(scene_file, capsys):  # noqa: F811
    (scene_file.parent / "TF02.safetensors").write_bytes(b"damaged")
    assert main(["view", str(scene_file), "--no-browser"]) == 2
    assert "models.TF02" in capsys.readouterr().err


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(
    ("stdin", "is_saved"),
    [(Terminal("y\n"), True), (Terminal("\n"), False), (Terminal(""), False), (io.StringIO(), False)],
)
def test_unsaved_edits_are_asked_about_or_told(scene_file, monkeypatch, capsys, stdin, is_saved):  # noqa: F811
    edits = Server(open_scene(scene_file)).edits
    view.ask_to_save(edits)
    assert capsys.readouterr().out == "", "nothing is unsaved"
    edits.change(Edit("TF01", "visible", False, 0), author=1)
    monkeypatch.setattr("sys.stdin", stdin)
    view.ask_to_save(edits)
    said = capsys.readouterr()
    if isinstance(stdin, Terminal):
        assert "Edits are not saved. Write them to" in said.out
    else:
        assert said.err == "Edits were not saved.\n", "nobody can be asked"
    assert read_scene(scene_file).models["TF01"].edit.visible is not is_saved


def test_another_file_is_not_replaced_without_a_word(scene_file, monkeypatch, capsys):  # noqa: F811
    """Scenes of jobs are saved as edited.yaml, which may be there; a name that is none is asked for again."""
    own = scene_file.parent / "own"
    own.mkdir()
    monkeypatch.chdir(own)
    (scene_file.parent / "metrics.json").write_text("{}")
    (own / "edited.yaml").write_text("mine")
    edits = Server(open_scene(scene_file)).edits
    edits.change(Edit("TF01", "visible", False, 0), author=1)
    monkeypatch.setattr("sys.stdin", Terminal("n\n"))
    view.ask_to_save(edits)
    assert "edited.yaml? The file there is replaced. [y/N]" in capsys.readouterr().out
    assert (own / "edited.yaml").read_text() == "mine"
    monkeypatch.setattr(edits, "name", "../no.yaml")
    monkeypatch.setattr("sys.stdin", Terminal("other.yaml\ny\n"))
    view.ask_to_save(edits)
    assert "save as: expected" in capsys.readouterr().err
    assert not read_scene(own / "other.yaml").models["TF01"].edit.visible


def test_nothing_is_saved_into_a_result_of_the_workflow(scene_file, monkeypatch):  # noqa: F811
    monkeypatch.chdir(scene_file.parent)
    (scene_file.parent / "metrics.json").write_text("{}")
    with pytest.raises(
        ArgumentError, match=r"is a result of the workflow, .* in another folder, or with --fold"
    ):
        Server(open_scene(scene_file)).edits.save("edited.yaml")
