"""Every command of the README and of docs/ is one, and runs on small volumes and with few iterations.

The default suite parses each command and composes its configuration; marked `docs`, each is run.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import nibabel
import numpy as np
import pytest
import pyvista
import SimpleITK

import texgs
from tests.fitting.short_fits import shorten
from tests.one_thread import one_thread  # noqa: F401
from texgs.cli.main import STAGE_VERBS, VERBS, main, parse
from texgs.config.compose import compose

ROOT = Path(__file__).parents[1]
USED = ("usage", "figure", "data", "fits", "scenes", "looks", "workflow", "api")
PAGES = ("README.md", *(f"docs/{name}.md" for name in USED))
OTHERS = {path.relative_to(ROOT).as_posix() for path in [ROOT / "CONTRIBUTING.md", *ROOT.glob("docs/*.md")]}
ALL = (*PAGES, *sorted(OTHERS - set(PAGES)))  # later pages use what earlier ones wrote

SMALL = """
    views=small views.width=32 views.height=32 views.train.frequency=1 views.test.count=2
    views.turntable=2 fit.seeds.count=300 fit.shading.iterations=30 fit.gaussians.iterations=30
    fit.gaussians.seeds.count=300 edit.image.iterations=5 edit.text.size=64 mesh.voxel=0.02
    tracking=none
"""


PLAN = "{python} -m snakemake --snakefile {root}/Snakefile --dry-run"
# Commands that are not run as they stand: what is run instead (nothing: the command is skipped), and why.
INSTEAD = (
    (r"make ", "make --directory {root} --dry-run {words}", "it installs, or runs this test again"),
    (r"\./replicate", "", "it installs; test_the_script_without_parameters_runs_the_workflow reads it"),
    (r"texgs series ", "texgs series --help", "it needs files of steps; test_series.py has some"),
    (r"texgs (edit|render) steps/", "", "it needs such a series; test_series.py runs these verbs"),
    (r"texgs study", "texgs study --help", "it takes scenes of several methods"),
    (r"texgs view ", "texgs view --help", "it serves until it is interrupted"),
    (r"texgs votes", "texgs votes --help", "it takes votes of people"),
    (r"source ", "", "activates the environment that `make install` makes"),
    (r"pip install ", "{python} -m pip {words} --help", "it would change the environment of this test"),
    (r"mlflow ui ", "{python} -m mlflow ui --help", "it starts a server"),
    (r"texgs weights .", "texgs weights --help", "it downloads"),
    (r"texgs doctor --experiment paper", "texgs doctor --experiment demo", "it plans 1,000 jobs"),
    (r"texgs run experiment=paper ", "texgs run experiment=demo --dry-run", "it plans 1,000 jobs"),
    (r"texgs run dataset=vortex ", "texgs run {words} --dry-run", "its views have to be downloaded"),
    (r"texgs run dataset=scan fit=quick$", "texgs run {words} sheets", "that of figure.md goes on"),
    (r"texgs run dataset=scan .* views.width", "texgs run dataset=scan fit=quick", "its views are large"),
    (r"snakemake .*/profiles/local ", f"{PLAN} {{words}}", "texgs run runs the same workflow"),
    (r"snakemake .*/profiles/slurm ", f"{PLAN} --executor local --cores 1 {{words}}", "it needs a cluster"),
    (r"(ssh|git clone|tmux)( |$)", "", "it needs another machine"),
    (r"ln -s ", "", "it would change the installation"),
)


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), flags=re.DOTALL)


def commands():
    """Page, folder and command, each of the last two once; a block starts in the project's folder."""
    pages = {}
    for page in ALL:
        for block in blocks(page, "sh"):
            folder = "."
            for line in filter(str.strip, block.splitlines()):
                if line.startswith("cd "):
                    folder = line.removeprefix("cd ")
                else:
                    pages.setdefault((folder, line.removeprefix(".venv/bin/")), page)
    return [(page, folder, line) for (folder, line), page in pages.items()]


COMMANDS = commands()


def ball(size):
    """Values [Z, Y, X] that fall with the distance from the centre of a cube."""
    axes = np.meshgrid(*[np.linspace(-1, 1, size)] * 3, indexing="ij")
    return (255 * np.clip(1.2 - np.linalg.norm(axes, axis=0), 0, 1)).astype(np.uint8)


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A project folder, with small volumes under the names that the pages have."""
    folder = tmp_path_factory.mktemp("readme") / "project"
    assert main(["init", str(folder)]) == 0
    values = ball(24)
    grid = pyvista.ImageData(dimensions=values.shape)
    grid.point_data["ImageScalars"] = values.ravel(order="F")
    grid.save(folder / "engine.vti")
    labels = np.digitize(values, np.quantile(values, [0.8, 0.9])).astype(np.uint8)
    for name, samples in (("scan", values), ("ct", values), ("segmentation", labels)):
        nibabel.save(nibabel.Nifti1Image(samples, np.eye(4)), folder / f"{name}.nii.gz")
    SimpleITK.WriteImage(SimpleITK.GetImageFromArray(labels), folder / "segmentation.seg.nrrd")
    (keys,) = (block for block in blocks("docs/scenes.md", "yaml") if "azimuth" in block)
    (folder / "keys.yaml").write_text(keys)
    return folder


def instead(command):
    """What is run instead of a command."""
    for pattern, replacement, _ in INSTEAD:
        if re.match(pattern, command):
            words = command.partition(" ")[2].removeprefix("run ")
            if command.startswith("snakemake"):
                words = words.replace("workflow/profiles", f"{ROOT}/workflow/profiles")
                words = words.replace("experiment=paper", "experiment=demo")  # 26 jobs to plan, not 242
            return replacement.format(root=ROOT, python=sys.executable, words=words)
    assert command.startswith("texgs "), f"{command}: add how it is tested, or why not, to INSTEAD"
    return command


def small(words):
    """The words of a texgs command with small views, fits and films."""
    verb, *rest = words
    if any(word.startswith("dataset=") for word in rest) and "--help" not in rest:
        given = {word.partition("=")[0] for word in rest}
        return [verb, *(word for word in SMALL.split() if word.partition("=")[0] not in given), *rest]
    if verb == "render":
        rest = [word for word in rest if word not in ("--width", "1200")]
        frames = ["--frames", "3"] if "--path" in rest else ["--fps", "1"] if "--film" in rest else []
        return [verb, *rest, "--width", "32", "--height", "32", *frames]
    if verb == "export" and "mesh" in rest:
        return [*words, "--voxel", "0.02"]
    if verb == "segment":
        return [*words, "--views", "12", "--size", "64"]
    return words


EACH = pytest.mark.parametrize(
    ("page", "folder", "command"), COMMANDS, ids=[f"{page}: {command}" for page, _, command in COMMANDS]
)


def first_value(values):
    """The first of the values of a sweep, with a whole number as one."""
    try:
        return f"={float(values[1]):g}"
    except ValueError:
        return f"={values[1]}"


def overrides(words):
    """The keys of a command with values that exist here; of several values the first."""
    keys = [word for word in words if re.match(r"[a-z][\w.]*=", word) and "/" not in word.partition("=")[0]]
    keys = [re.sub(r"=([^\[,]+),.*", first_value, word) for word in keys]
    return tuple(word.replace("dataset=scan", "dataset=engine") for word in keys)


@EACH
def test_command_can_be_parsed_and_composed(page, folder, command):
    if not command.startswith(("texgs", "snakemake")):
        assert instead(command) is not None
        return
    program, *words = shlex.split(os.path.expandvars(command))
    try:
        verb = parse(words).verb if program == "texgs" else "run"
    except SystemExit:  # of --help
        assert words[-1] == "--help"
        return
    if program == "snakemake":
        nested = [word.partition("=")[2] for word in words if word.startswith("overrides=")]
        words = [word for word in words if not word.startswith("overrides=")] + shlex.split(" ".join(nested))
    if verb == "run" or verb in STAGE_VERBS:
        compose(overrides(words))


@pytest.mark.docs
@EACH
def test_command_runs(page, folder, command, project, monkeypatch):
    """In their order: later ones use what earlier ones wrote."""
    if command.startswith("make") and shutil.which("make") is None:
        pytest.skip("make is not installed")
    substitute = instead(command)
    if not substitute:
        pytest.skip(next(reason for pattern, _, reason in INSTEAD if re.match(pattern, command)))
    if "profiles/slurm" in command:
        pytest.importorskip("snakemake_executor_plugin_slurm")
    place = project / folder
    monkeypatch.chdir(place if place.is_dir() else project)  # some pages name folders of other machines
    monkeypatch.setenv("TEXGS_DATA", str(project))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    code, said = run(shlex.split(os.path.expandvars(substitute)))
    assert code == 0, said


def run(words):
    """Exit code, and what was said; a verb other than `run` stays in this process, which saves time."""
    if words[0] == "texgs":
        words = ["texgs", *small(words[1:])]
        if words[1] != "run":
            try:
                return main(words[1:]), ""
            except SystemExit as end:  # of --help
                return end.code, ""
        words = [sys.executable, "-P", "-m", "texgs.cli.main", *words[1:]]
    done = subprocess.run(words, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def test_the_readme_is_short_and_begins_with_two_commands():
    assert [command for _, _, command in COMMANDS[:2]] == ["make demo", "make test"]
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120


def test_what_is_not_run_is_on_a_page():
    for pattern, _, _ in INSTEAD:
        assert any(re.match(pattern, command) for _, _, command in COMMANDS), f"no command is {pattern}"


@pytest.mark.parametrize("page", ALL)
def test_links_lead_somewhere_and_to_every_page(page):
    """Pictures, pages and files of results."""
    targets = re.findall(r"\]\(([^)#]+)", (ROOT / page).read_text(encoding="utf-8"))
    for target in targets:
        there = target.startswith("http") or (ROOT / page).parent.joinpath(target).exists()
        assert there, f"{target} is missing"
    if page == "README.md":
        assert set(ALL[1:]) <= set(targets)


@pytest.mark.docs
def test_python_examples_run(project, monkeypatch):
    """Those of a notebook, with small views, of the rasterizer and of a field."""
    monkeypatch.chdir(project)
    monkeypatch.setenv("TEXGS_DATA", str(project))
    code, said = run(shlex.split("texgs compose dataset=engine fit=quick"))
    assert code == 0, said
    examples = blocks("docs/api.md", "python")
    assert len(examples) == 3
    shorten(monkeypatch, frequency=1, surfels=300, iterations=20)
    for example in examples:
        assert len(example.splitlines()) <= 20
        exec(example.replace("size=200", "size=40"), {})
    assert (project / "surfels.png").stat().st_size > 10_000
    assert "opacity: 0.4" in (project / "blob" / "scene.yaml").read_text()


@pytest.mark.docs
def test_python_of_the_readme_runs():
    """Of an array, with small views and a short fit."""
    few = ("views.train.frequency=1", "fit.shading.iterations=30", "views.step=1")
    small = SimpleNamespace(Volume=texgs.Volume, fit=partial(texgs.fit, size=32, overrides=few))
    (example,) = blocks("README.md", "python")
    names = {"texgs": small, "array": ball(20)}
    exec(example, names)
    assert names["scene"].psnr(views=2, width=24) > 15


def test_what_a_user_writes_is_shown_as_it_is_tested():
    """tests/metrics, tests/models and tests/workflow run the toys as texgs's own."""
    toys = ROOT / "tests" / "toys"
    names = ("fade", "brightness", "projection", "editor")
    shown = [(toys / f"{name}.py").read_text(encoding="utf-8") for name in names]
    assert blocks("docs/extend.md", "python") == shown


@pytest.mark.docs
def test_the_script_without_parameters_runs_the_workflow(project, monkeypatch):
    """The files that it lists at its end are among those that the run makes."""
    text = (ROOT / "replicate.sh").read_text(encoding="utf-8").splitlines()[-1]
    _, install, words, listing = text.split(" && ")
    assert install == "make install"
    monkeypatch.chdir(project)
    monkeypatch.setenv("TEXGS_DATA", str(project))
    paths = listing.removeprefix("ls -l ").split()
    code, said = run([*shlex.split(words.removeprefix(".venv/bin/")), *paths, "--dry-run"])
    assert code == 0, said


def test_the_page_of_commands_names_every_verb():
    page = (ROOT / "docs" / "usage.md").read_text(encoding="utf-8")
    assert [verb for verb in VERBS if f"`{verb}`" not in page] == []
