"""What a stage of the workflow is: the configuration it reads, the code it runs, the place of its files.

A stage is one module of texgs/workflow/stages, see `stage_table`. Its settings are a dataclass whose fields
say by `read` which values of the configuration they have.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property
from inspect import signature
from operator import attrgetter
from pathlib import Path
from typing import Any, Literal, cast, get_type_hints

from texgs.config.schema import Config
from texgs.core.cache import digest
from texgs.core.errors import ConfigError
from texgs.edit.method import methods
from texgs.fields.kinds import kinds
from texgs.metrics.metric import metrics
from texgs.report.results import Result
from texgs.workflow.code import code_digest
from texgs.workflow.sweep import edit_variant, fit_variant

RULES: dict[str, "Rule"] = {}  # those of all stages, by name; texgs.workflow.stage_table fills it
ALL_THREADS = 1024  # threads, of which a job gets as many as there are


@dataclass(frozen=True)
class Rule:
    """A rule of the workflow, of one stage or of several alike: where its jobs write, and what they take."""

    name: str
    folder: str  # of wildcards dataset, tf, views, fit, phase, edit and gallery
    files: tuple[str, ...] = ()  # the first is the one that other jobs ask for; metrics.json comes with all
    target: str = ""  # what `texgs run` calls all its jobs, together with those of some other rules
    threads: int = 4
    gpu: tuple[Literal["views", "fit"], ...] = ()  # what a GPU is for, where the configuration asks for one
    swept: bool = False  # whether a sweep makes it of each variant; what these read is made anyway
    shown: Mapping[str, str] = field(default_factory=dict)  # captions of files in the report of Snakemake


@dataclass(frozen=True)
class Outcome:
    """A result for metrics.json, and pictures for the report and the tracked run."""

    result: Result
    pictures: Mapping[str, str] | None = None  # captions of files of the output; default those of the rule


@dataclass(frozen=True)
class Stage:
    """One arrow of the data flow: a verb of the command line, and a job of the workflow.

    Its module imports nothing heavy before `work` is called.
    """

    name: str
    order: int  # among the stages: behind those whose files it reads
    help: str  # what it does, in `texgs --help`
    rule: Rule
    inputs: Callable[[Config], dict[str, Path]]  # the files it reads, by name
    work: Callable[[Any, dict[str, Path], Path], Outcome]  # its job: from settings and inputs to a folder
    applies: Callable[[Config], bool] = lambda config: True  # whether a data set or edit goes through it
    fits: str = ""  # module of the kind of field that it fits

    @property
    def module(self) -> str:
        """What the job runs."""
        return self.work.__module__

    @cached_property
    def schema(self) -> type[Any]:
        """Dataclass of its settings, whose fields say what they `read`: the first that `work` takes."""
        first = next(iter(signature(self.work).parameters), "settings")
        schema = get_type_hints(self.work).get(first)
        if not is_dataclass(schema):
            got = "none" if schema is None else getattr(schema, "__name__", schema)
            raise ConfigError(
                f"stage {self.name}: work: expected a dataclass as annotation of {first}, such as "
                f"`{first}: OfDataset`, got {got}"
            )
        return cast(type[Any], schema)

    @property
    def place(self) -> str:
        """Name of its rule."""
        return self.rule.name

    @property
    def per_tf(self) -> bool:
        """Whether there is a job for each basic TF, not for the whole data set."""
        return "{tf}" in self.rule.folder

    def settings(self, config: Config) -> dict[str, Any]:
        """Return what a job reads, as plain lists and dicts."""
        return cast(dict[str, Any], plain_values({"stage": self.name, **values_read(self.schema, config)}))

    def output(self, config: Config) -> Path:
        """Return the folder of the job's files."""
        return folder_of(self.rule.name, config, phase=self.name)

    def code(self, settings: Mapping[str, Any]) -> str:
        """Return the digest of the code that a job runs: of its stage, kind of field, method and metrics.

        All but the first are found by their names, so the sources of the stage do not tell.
        """
        modules = [self.module, self.fits] if self.fits else [self.module]
        if self.place != "phase" and "fit" in settings:
            modules += kinds()[settings["fit"]["field"]].modules
        if "edit" in settings:
            modules.append(methods()[settings["edit"]["method"]].module)
        if self.name == "edit_metrics":
            modules += [metric.run.__module__ for metric in metrics().values()]
        return digest(" ".join(map(code_digest, modules)))


def read(source: str | Callable[[Config], Any]) -> Any:
    """Return the field of settings that has a value of the configuration.

    Args:
        source: the key of the configuration, such as `"fit.seed"`, or a function of it.
    """
    return field(metadata={"read": attrgetter(source) if isinstance(source, str) else source})


def values_read(schema: type[Any], config: Config) -> dict[str, Any]:
    """Return the values that the fields of a dataclass, and of its parts, read of a configuration."""
    hints, values = get_type_hints(schema), {}
    for each in fields(schema):
        if "read" in each.metadata:
            try:
                values[each.name] = each.metadata["read"](config)
            except AttributeError as error:
                where = f"{schema.__module__}: {schema.__name__}.{each.name}"
                raise ConfigError(f"{where}: reads what the configuration has not: {error}") from error
        elif is_dataclass(part := hints[each.name]):
            values[each.name] = values_read(cast(type[Any], part), config)
    return values


def plain_values(value: Any) -> Any:
    """Return a value of a configuration, or tables and lists of them, as plain dicts and lists."""
    if is_dataclass(value):
        return {each.name: plain_values(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, Mapping):
        return {str(name): plain_values(each) for name, each in value.items()}
    return [plain_values(each) for each in value] if isinstance(value, list | tuple) else value


def folder_of(rule: str, config: Config, phase: str = "", tf: str | None = None) -> Path:
    """Return the folder of a job's files; `tf`: of another basic TF than `config.tf`."""
    return Path(config.results) / RULES[rule].folder.format(
        dataset=config.dataset.name,
        tf=tf or config.tf,
        views=config.views.name,
        fit=fit_folder(config),
        phase=phase,
        edit=edit_folder(config),
        gallery=config.gallery.name,
    )


def result_file(rule: str, config: Config, phase: str = "", tf: str | None = None) -> Path:
    """Return the file of a job that other jobs ask for."""
    return folder_of(rule, config, phase, tf) / RULES[rule].files[0]


def fit_folder(config: Config) -> str:
    """Return the name of a fit's folder: the recipe, the variant of a sweep, and a seed other than 0."""
    return _folder(config.fit.name, fit_variant(config), config.fit.seed)


def edit_folder(config: Config, name: str = "") -> str:
    """Return that of an edit in the same way; `name`: of another edit than that of `config`."""
    return _folder(name or config.edit.name, edit_variant(config), config.edit.seed)


def _folder(name: str, variant: str, seed: int) -> str:
    return "-".join(filter(None, (name, variant, f"s{seed}" if seed else "")))
