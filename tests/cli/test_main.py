import subprocess
import sys

import pytest

from texgs import __version__
from texgs.cli import doctor
from texgs.cli.main import VERBS, main
from texgs.core.errors import ArgumentError


def test_help_lists_every_verb(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["--help"])
    assert stop.value.code == 0
    out = capsys.readouterr().out
    assert all(verb in out for verb in VERBS)


def test_version(capsys):
    with pytest.raises(SystemExit):
        main(["--version"])
    assert capsys.readouterr().out == f"texgs {__version__}\n"


def test_an_error_is_one_sentence_and_code_2(monkeypatch, capsys):
    def fail(_arguments):
        raise ArgumentError("size: expected at least 1 pixel, got 0")

    monkeypatch.setattr(doctor, "run", fail)
    assert main(["doctor"]) == 2
    assert capsys.readouterr().err == "texgs doctor: size: expected at least 1 pixel, got 0\n"


def test_the_command_line_starts_without_heavy_imports():
    """Help must answer at once: torch alone takes seconds to import."""
    code = (
        "import sys; import texgs.cli.main as m; m.parser();"
        "heavy = {'torch', 'kornia', 'numpy', 'PIL', 'tqdm', 'omegaconf', 'mlflow'};"
        "print(*(heavy & {name.split('.')[0] for name in sys.modules}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
