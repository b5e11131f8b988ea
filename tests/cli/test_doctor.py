import subprocess

from texgs.cli import doctor
from texgs.cli.doctor import Finding, examine, show
from texgs.cli.main import main


def test_report_has_a_line_per_probe_and_all_is_well_here(capsys):
    assert main(["doctor"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(doctor.PROBES)
    assert {line.split()[0] for line in lines} <= {"ok", "warning", "missing"}


def test_only_a_required_thing_fails(capsys):
    optional = ("weights", Finding("missing", "none", "download them"))
    required = ("torch", Finding("missing", "not installed", "pip install torch"))
    assert show([optional]) == 0
    assert "weights          none -> download them" in capsys.readouterr().out
    assert show([optional, required]) == 1
    assert "texgs cannot work yet: torch" in capsys.readouterr().err


def test_a_broken_probe_does_not_stop_the_others():
    finding = examine({}.__getitem__)
    assert (finding.state, show([("weights", finding)])) == ("missing", 1)


def test_a_crash_of_the_opengl_probe_is_a_finding(monkeypatch):
    died = subprocess.CompletedProcess([], returncode=-11, stdout="", stderr="")
    monkeypatch.setattr(subprocess, "run", lambda *_args, **_kwargs: died)
    finding = doctor.opengl()
    assert finding.state == "missing"
    assert finding.found == "the probe died of signal 11"
    assert "libegl1" in finding.advice


def test_weights_are_listed(monkeypatch, tmp_path):
    for name in ("TEXGS_WEIGHTS", "TEXGS_CACHE", "TORCH_HOME", "HF_HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    finding = doctor.weights()
    assert (finding.state, finding.found[:14]) == ("missing", "none of vgg16,")
    (folder := tmp_path / "clip-vit-base-patch32").mkdir()
    for name in ("config.json", "model.safetensors", "vocab.json"):
        (folder / name).touch()
    finding = doctor.weights()
    assert finding.state == "ok"
    assert finding.found.startswith("clip-vit-base-patch32; not vgg16, ")
    (tmp_path / "mobile_sam.pt").touch()
    assert doctor.weights().state == "warning", "another file of that name"


def test_a_machine_on_which_no_stage_can_run_is_broken(monkeypatch, tmp_path):
    monkeypatch.setattr("texgs.config.project.ROOT", tmp_path)
    finding = examine(doctor.configuration)
    assert finding.state == "missing"
    assert "no configuration there" in finding.found
    monkeypatch.setattr(
        "importlib.metadata.requires", lambda name: ["no-such-package>=1", "torch>=99", "x; extra=='y'"]
    )
    finding = doctor.packages()
    assert finding.state == "missing"
    assert finding.found.startswith("no no-such-package, torch 2.")


def test_a_cache_that_cannot_be_is_told_with_what_to_set(monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setenv("TEXGS_CACHE", str(tmp_path / "file" / "cache"))
    finding = doctor.cache()
    assert finding.state == "missing"
    assert "TEXGS_CACHE" in finding.advice

    def none():
        raise RuntimeError("Could not determine home directory.")

    for name in ("TEXGS_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("pathlib.Path.home", none)
    finding = examine(doctor.cache)
    assert finding.found == "HOME: expected the home folder of this user, got none"
    assert finding.advice.startswith("set TEXGS_CACHE")
