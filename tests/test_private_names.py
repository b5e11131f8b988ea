"""What texgs uses of Hydra, Snakemake and MLflow without documentation: in one file each, and still there."""

import ast
import importlib
import inspect
import re
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FILES = [*sorted((ROOT / "texgs").rglob("*.py")), ROOT / "Snakefile", *(ROOT / "workflow").rglob("*.smk")]
# The file that is at home with a package, and which of its modules others may import.
HOMES = {
    "hydra": ("texgs/config/composition.py", r"hydra\.errors"),
    "omegaconf": ("texgs/config/composition.py", r"omegaconf\.errors"),
    "snakemake": ("texgs/cli/snakemake.py", r"snakemake\.utils"),
    "mlflow": ("texgs/workflow/runs.py", "mlflow nowhere else"),
}
PACKAGES = {"hydra": "hydra-core"}  # where packages have other names than their modules
# What the homes use of objects: where it is, and the text that is to be in its source.
USED = (
    ("snakemake.api:SnakemakeApi", "def print_exception(self, ex"),
    ("snakemake.workflow:Workflow", "def local_exec(self)"),
    ("snakemake.workflow:Workflow", "def scheduler(self)"),
    ("snakemake.workflow:Workflow", "def dag(self)"),
    ("snakemake.workflow:Workflow", "self.output_settings"),
    ("snakemake.workflow:Workflow", "logger_manager"),
    ("snakemake.settings.types:OutputSettings", "log_handler_settings"),
    ("snakemake.logging:LoggerManager", "self.queue_listener = "),
    ("snakemake.logging:LoggerManager", "def get_log_handlers(self)"),
    ("snakemake.dag:DAG", "def jobs(self)"),
    ("snakemake.dag:DAG", "def needrun_jobs(self"),
    ("snakemake.scheduling.job_scheduler:JobScheduler", "self.failed = "),
    ("snakemake.scheduling.job_scheduler:JobScheduler", "if self.job_rate_limiter is None"),
    ("hydra._internal.config_repository:ConfigRepository", "def load_config(self, config_path"),
    ("hydra._internal.defaults_list:create_defaults_list", "prepend_hydra: bool"),
    ("mlflow.store.tracking.sqlalchemy_store:SqlAlchemyStore", "self, db_uri, default_artifact_root"),
)


def imports(path):
    """Yield the modules that a file imports, wherever it does, with what it takes of each."""
    code = path.read_text(encoding="utf-8")
    if path.suffix != ".py":  # of Snakemake, which is Python in such lines
        code = "\n".join(re.findall(r"^(?:from [\w.]+ )?import .*$", code, re.MULTILINE))
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            yield from ((alias.name, None) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield from ((node.module, alias.name) for alias in node.names)


@pytest.mark.parametrize("package", HOMES)
def test_one_file_uses_what_is_not_documented(package):
    home, allowed = HOMES[package]
    others = [path for path in FILES if path.relative_to(ROOT).as_posix() != home]
    strange = [
        f"{path.relative_to(ROOT)} imports {module}; only {home} may, which says why"
        for path in others
        for module, _ in imports(path)
        if module.split(".")[0] == package and not re.fullmatch(allowed, module)
    ]
    assert not strange, "\n".join(strange)


@pytest.mark.parametrize("package", HOMES)
def test_what_it_uses_is_there(package):
    home, _ = HOMES[package]
    taken = [(module, name) for module, name in imports(ROOT / home) if module.split(".")[0] == package]
    missing = [
        f"{module}.{name}"
        for module, name in taken
        if name is not None and not hasattr(importlib.import_module(module), name)
    ]
    for place, text in USED:
        module, _, name = place.partition(":")
        if module.split(".")[0] == package and text not in inspect.getsource(
            getattr(importlib.import_module(module), name)
        ):
            missing.append(f"`{text}` of {place}")
    name = PACKAGES.get(package, package)
    assert not missing, (
        f"{name} {version(name)} has no {', '.join(missing)}: adapt {home}, or lower the bound of {name} "
        "in pyproject.toml"
    )


@pytest.mark.parametrize("package", HOMES)
def test_its_versions_have_an_upper_bound(package):
    name = PACKAGES.get(package, package)
    asked = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    (bounds,) = (line for line in asked if re.match(rf"{name}\W", line))
    assert ",<" in bounds


def test_nothing_else_takes_private_names():
    """Of other packages; a name that begins with an underscore is one."""
    private = [
        f"{path.relative_to(ROOT)} imports {module}.{name}"
        for path in FILES
        for module, name in imports(path)
        if re.search(r"(^|\.)_[^_]", f"{module}.{name or ''}")
        and path.relative_to(ROOT).as_posix() != HOMES["hydra"][0]
        and not module.startswith("texgs")
    ]
    assert not private, "\n".join(private)
