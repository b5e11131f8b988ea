import importlib
import os
import subprocess
import sys

import pytest

from texgs import __version__
from texgs.cli import doctor
from texgs.cli.main import STAGE_VERBS, VERBS, main
from texgs.core.errors import ArgumentError


def test_help_lists_every_verb(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--help"])
    assert stop.value.code == 0
    out = capsys.readouterr().out
    assert all(f"\n  {verb} " in out for verb in VERBS)
    assert out.index("  render ") < out.index("  texture ") < out.index("  edit_arf ")
    for verb in [*(set(VERBS) - set(STAGE_VERBS)), "views"]:
        with pytest.raises(SystemExit, match="0"):
            main([verb, "--help"])
        out = capsys.readouterr().out
        assert out.startswith(f"usage: texgs {verb} [-h]")
    with pytest.raises(SystemExit):
        main(["--version"])
    assert capsys.readouterr().out == f"texgs {__version__}\n"
    assert "views.fov_y=30.0" in out
    assert "dataset=" in out


def test_a_mistake_in_a_stage_of_ones_own_is_one_sentence(tmp_path):
    text = "from texgs.workflow.stage import Rule\nRule('toy', 'toy', filse=())\n"
    (tmp_path / "broken.py").write_text(text)
    code = f"from texgs.workflow import stages\nstages.__path__.append({str(tmp_path)!r})\n"
    code += "import texgs.cli.main"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 2
    told = "texgs: texgs.workflow.stages.broken, line 2: TypeError where it is imported: Rule.__init__() got "
    assert done.stderr.startswith(f"{told}an unexpected keyword argument 'filse'")
    assert len(done.stderr.splitlines()) == 1


def test_an_error_is_one_sentence_and_code_2(monkeypatch, capsys):
    def fail(_arguments):
        raise ArgumentError("size: expected at least 1 pixel, got 0")

    monkeypatch.setattr(doctor, "run", fail)
    assert main(["doctor"]) == 2
    assert capsys.readouterr().err == "texgs doctor: size: expected at least 1 pixel, got 0\n"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["rnu"], "texgs rnu: no such verb, did you mean run?"),
        ([], "texgs: the following arguments are required: VERB; see texgs --help"),
        (["doctor", "--bogus"], "texgs doctor: unrecognized arguments: --bogus; see texgs doctor --help"),
        (
            ["render", "a", "--widht=9"],
            "texgs render: unrecognized arguments: --widht=9, did you mean --width?",
        ),
        (
            ["edit", "a", "--outptu", "b"],
            "texgs edit: unrecognized arguments: --outptu, did",
        ),
        (["NEW"], "texgs NEW: no such verb, did you mean new?"),
        (["run", "--jobs"], "snakemake: argument --jobs/-j: expected one argument; see snakemake --help"),
        (["run", "--cores", "x"], "texgs run: Error parsing number of cores (--cores, -c): must be integer"),
    ],
)
def test_a_wrong_word_is_told_in_one_sentence(words, message):
    command = [sys.executable, "-m", "texgs.cli.main", *words]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(message)
    assert done.stderr.count("\n") == 1


def test_the_command_line_starts_without_heavy_imports():
    """Help must answer at once: torch alone takes seconds to import."""
    code = (
        "import sys; import texgs.cli.main as m; m.overview(); [m.parser(verb) for verb in m.VERBS];"
        "heavy = {'torch', 'kornia', 'numpy', 'PIL', 'tqdm', 'omegaconf', 'mlflow'};"
        "print(*(heavy & {name.split('.')[0] for name in sys.modules}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


MISTAKES = """
rnu | render scene.yaml --flim a | view nowhere.yaml | edit scene.yaml TF01.opactiy=1 --output new.yaml
render scene.yaml --mode nromal | export scene.yaml --kind mehs --to x.ply | check nowhere.yaml
segment scene.yaml --name a --width 0 | study nowhere | report nowhere | views dataset=engin
views views.widht=3 | run dataset=engin --dry-run | run fit=quick views.widht=3 al
"""


def test_mistakes_are_told_without_heavy_imports(tmp_path):
    """Torch and Snakemake take a second each."""
    (tmp_path / "scene.yaml").touch()
    words = [line.split() for line in MISTAKES.replace("|", "\n").split("\n") if line]
    code = f"""
import sys
from texgs.cli.main import main
for words in {words}:
    try:
        code = main(words)
    except SystemExit as end:
        code = end.code
    print(code, *({{'torch', 'snakemake', 'cv2', 'mlflow'}} & {{*sys.modules}}))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert done.stdout.split("\n") == [*["2"] * len(words), ""], done.stderr
    assert done.stderr.count("\n") == len(words)


@pytest.mark.parametrize(
    ("verb", "message"),
    [
        ("texture", "texgs texture: interrupted; the same command goes on with what is not done\n"),
        ("doctor", "texgs doctor: interrupted; the same command starts again\n"),
    ],
)
def test_an_interruption_says_how_to_go_on(monkeypatch, capsys, verb, message):
    def interrupt(_arguments):
        raise KeyboardInterrupt

    module = importlib.import_module(f"texgs.cli.{'stage' if verb in STAGE_VERBS else verb}")
    monkeypatch.setattr(module, "run", interrupt)
    assert main([verb]) == 130
    assert capsys.readouterr().err == message


@pytest.mark.parametrize("words", [["--help"], ["views", "--help"], ["doctor"]])
def test_a_reader_that_goes_away_is_no_error(words):
    """As `| head` does: the pipe is closed before anything is written. Help of argparse ends with 0 then."""
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "texgs.cli.main", *words]
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True)
    os.close(write)
    assert done.returncode in (0, 141)
    assert done.stderr == ""


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize(("words", "code"), [(["init", "project"], 0), (["--help"], 0), (["rnu"], 2)])
def test_streams_that_are_closed_are_no_error(tmp_path, closed, words, code):
    """As cron, or a program with windows, may leave them."""
    command = ["sh", "-c", f'exec "$@" {closed}', "sh", sys.executable, "-m", "texgs.cli.main", *words]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, "Traceback" in done.stderr) == (code, False)
    assert (tmp_path / "project" / "conf").exists() == ("init" in words)


def test_no_file_gets_the_number_of_a_closed_stream(tmp_path):
    """Else what a library or a child writes to the stream would be written into that file."""
    code = """
import os, subprocess
from texgs.cli.main import open_closed_streams
open_closed_streams()
with open("precious", "wb"):
    subprocess.run(["sh", "-c", "echo of a child; echo of a child >&2"], check=True)
    os.write(1, b"of a library")
"""
    command = ["sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", sys.executable, "-c", code]
    assert subprocess.run(command, cwd=tmp_path).returncode == 0
    assert (tmp_path / "precious").read_bytes() == b""


ASCII = {"PYTHONIOENCODING": "ascii", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.mark.parametrize(
    ("words", "code"), [(["volume", "--help"], 0), (["views", "dataset=\u00fc"], 2), (["init", "\u00fc"], 0)]
)
def test_a_terminal_without_unicode(tmp_path, words, code):
    command = [sys.executable, "-m", "texgs.cli.main", *words]
    done = subprocess.run(command, cwd=tmp_path, env={**os.environ, **ASCII}, capture_output=True)
    assert done.returncode == code
    assert b"Traceback" not in done.stderr
    assert (done.stdout + done.stderr).isascii()
