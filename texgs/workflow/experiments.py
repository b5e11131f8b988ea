"""What an experiment runs: a configuration for each data set, recipe, variant of a sweep and edit."""

import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields

from texgs.config.compose import compose
from texgs.config.dataset import Dataset
from texgs.config.project import Words, members
from texgs.config.schema import Config, StandIns
from texgs.core.errors import ConfigError
from texgs.core.names import close
from texgs.edit.method import NO_METHOD, method_of
from texgs.workflow.edits import edits
from texgs.workflow.stage import edit_folder
from texgs.workflow.stage_table import STAGES
from texgs.workflow.stand_ins import Taken, data_set, edit
from texgs.workflow.sweep import changes, is_of_edits, variants

OF_A_UNION = (
    "experiments",
    "common_overrides",
    "per_dataset",
    "on_missing",
)  # all that an experiment of experiments sets
NO_SWEEPS = ("sweeps={}", "sweeps=null", "sweep=none")  # what is written to switch them off
AIMED = re.compile(r"dataset\.([\w-]+)\.(([\w-]+)[^=]*=.*)", re.DOTALL)  # dataset.NAME.KEY=VALUE


@dataclass(frozen=True)
class LeftOut:
    """What a run goes on without."""

    what: str
    why: str  # one sentence


@dataclass(frozen=True)
class Case:
    """One configuration of a run, and the words that compose it."""

    words: Words

    @property
    def config(self) -> Config:
        """What the words compose."""
        return compose(self.words)

    @property
    def unedited(self) -> "Case":
        """The case of the fit alone."""
        return self if self.config.edit.method == NO_METHOD else Case((*self.words, "edit=none"))


@dataclass
class Selection:
    """The configurations of a run."""

    lacking: Callable[[Config], Sequence[str]]  # sentences on what a configuration lacks
    skips: bool  # whether what lacks something is left out
    by_sweep: dict[str, list[Case]] = field(default_factory=lambda: defaultdict(list))  # "": of none
    left_out: dict[LeftOut, dict[str, None]] = field(default_factory=dict)  # with the places of its jobs

    @property
    def configs(self) -> list[Config]:
        """All configurations, one after another."""
        return [case.config for some in self.by_sweep.values() for case in some]

    def takes(self, config: Config, what: str) -> bool:
        """Return whether a configuration is run; what is left out is noted."""
        reasons = self.lacking(config) if self.skips else ()
        for why in reasons:
            places = self.left_out.setdefault(LeftOut(what, why.removeprefix(f"{what}: ")), {})
            places.update(dict.fromkeys(stage.place for stage in STAGES.values() if stage.applies(config)))
        return not reasons

    def replaced(self, datasets: Sequence[Taken], edits: Sequence[Taken]) -> Words:
        """Note what lacks something and is replaced; return words for edits, and captions that tell it."""
        from texgs.config.composition import quoted

        for each in (*datasets, *edits):
            for why in each.lacks:
                told = f"{why.removeprefix(f'{each.what}: ').rstrip('. ')}; `{each.name}` stands in for it"
                self.left_out.setdefault(LeftOut(each.what, told), {})
        taken = ",".join(dict.fromkeys(each.name for each in edits))
        own = (f"edits=[{taken}]",) if any(each.caption for each in edits) else ()
        captions = " ".join(filter(None, (each.caption for each in (*datasets, *edits))))
        return (*own, f"gallery.note={quoted(captions)}") if captions else own

    def add(self, words: Words, several: bool) -> None:
        """Add one data set with one recipe: its fits and its edits, or those of each variant of its sweep.

        Of several recipes not each can be edited in every way.
        """
        config = compose((*words, "edit=none"))
        if not self.takes(config, f"data set {config.dataset.name}"):
            return
        listed = self.by_sweep[config.sweep.name if changes(config) else ""]
        made = [(each, *self.edited(each, several)) for each in variants(words)]
        if len({len(edited) for _, edited, _ in made}) > 1:
            return  # some variants alone compare nothing, and a gallery shows all
        for each, edited, left in made:
            if is_of_edits(config) and not edited:
                continue  # the fits alone are no variant of it
            own: Words = ()
            if left != compose(each).edits:  # a gallery then shows what is left
                own = f"edits=[{','.join(left)}]", "gallery.grids=[]"
            listed += [Case((*each, *own)).unedited, *edited]

    def edited(self, words: Words, several: bool) -> tuple[list[Case], list[str]]:
        """Return the edits that are possible and lack nothing, and what `edits` has left of them."""
        made: list[Case] = []
        gone: set[str] = set()
        for case in map(Case, edits(words)):
            config = case.config
            if config.edit.base in gone or not self.takes(config, f"edit {edit_folder(config)}"):
                gone.add(config.edit.name)
            elif not several or method_of(config.edit).takes(config.fit.field):
                made.append(case)
        return made, [name for name in compose(words).edits if name not in gone]


def selected(words: Words, lacking: Callable[[Config], Sequence[str]]) -> Selection:
    """Return the configurations that some words describe.

    Words of the form dataset.NAME.KEY=VALUE hold for one data set of the run. A data set that the words name
    wins over the list of the experiment, and is not left out where it lacks something, unless they say so.
    What a configuration is lacking on this machine is told in sentences.
    """
    plain, aimed = apart(words)
    base = compose(plain)
    is_asked_for = any(word.startswith("on_missing=") for word in plain) or not named(plain)
    selection = Selection(lacking, base.on_missing == "skip" and is_asked_for)
    reached: set[str] = set()
    of_union = base.per_dataset if base.experiments else {}
    for part in parts(plain, base):
        reached |= add_part(part, named(plain), joined(of_union, aimed), selection)
    if not reached:
        raise ConfigError(
            f"dataset: expected data sets of {', '.join(base.experiments)}, got {', '.join(named(plain))}"
        )
    if beside := next((name for name in aimed if name not in reached), None):
        raise ConfigError(
            f"dataset.{beside}: expected one of the data sets of this run, {', '.join(sorted(reached))}; "
            f"got {beside}"
        )
    return selection


def add_part(words: Words, wanted: list[str], aimed: Mapping[str, Words], selection: Selection) -> set[str]:
    """Add one experiment, and return the names of its data sets, of a union those that are wanted."""
    base = compose(words)
    check_listed(base)
    aimed, names = joined(base.per_dataset, aimed), named(words) or base.datasets

    def lacks(name: str) -> Sequence[str]:
        return selection.lacking(compose((*words, f"dataset={name}", *aimed.get(name, ()), "edit=none")))

    def taken(name: str) -> Taken:
        return data_set(StandIns() if name in wanted else base.stand_ins, name, lacks)

    datasets: dict[str, list[Taken]] = defaultdict(list)  # what they stand in for, by their names
    for each in map(taken, names or [base.dataset.name]):
        if not wanted or each.name in wanted:
            datasets[each.name].append(each)
    is_named = any(word.startswith("edits=") for word in words)
    edits = [] if is_named else [edit(base.stand_ins, name, words) for name in base.edits]
    for name, own in datasets.items():
        of_set = (*words, *((f"dataset={name}",) if names else ()), *aimed.get(name, ()))
        of_set = (*of_set, *selection.replaced(own, edits))
        for fitted in [(*of_set, f"fit={fit}") for fit in base.fits] or [of_set]:
            selection.add(fitted, len(base.fits) > 1)
    # Where the words name data sets and no sweeps, those of other data sets are not run.
    is_of_all = datasets and (not wanted or any(word.startswith("sweeps") for word in words))
    by_sweep = {sweep: taken(name).name for sweep, name in base.sweeps.items()}
    of_sweeps = {sweep: name for sweep, name in by_sweep.items() if is_of_all or name in datasets}
    beside = (*without(words, "sweep.name", "sweep.over"), "edit=none", "edits=[]")
    for sweep, name in of_sweeps.items():
        selection.add((*beside, f"dataset={name}", *aimed.get(name, ()), f"sweep={sweep}"), False)
    return {*datasets, *of_sweeps.values()}


def check_listed(base: Config) -> None:
    """Require of lists that they name nothing twice, and of stand-ins that there are files of them."""
    for key, listed in (("datasets", base.datasets), ("fits", base.fits)):
        if repeated := [name for name in listed if listed.count(name) > 1]:
            raise ConfigError(f"{key}: expected different names, got {repeated[0]} twice")
    for group, table in (("dataset", base.stand_ins.datasets), ("edit", base.stand_ins.edits)):
        known = members(group) if table else []
        if unknown := [name for name in (*table, *table.values()) if name not in known]:
            hint = close(unknown[0], known)
            raise ConfigError(f"stand_ins.{group}s: expected files of conf/{group}, got {unknown[0]}{hint}")


def joined(aimed: Mapping[str, Sequence[str]], later: Mapping[str, Sequence[str]]) -> dict[str, Words]:
    """Return the words that are aimed at each data set, first those of an experiment."""
    known = members("dataset")
    if unknown := [name for name in aimed if name not in known]:
        raise ConfigError(
            f"per_dataset: expected names of data sets, got {unknown[0]}{close(unknown[0], known)}"
        )
    return {name: (*aimed.get(name, ()), *later.get(name, ())) for name in {*aimed, *later}}


def parts(words: Words, base: Config) -> list[Words]:
    """Return the words of each experiment of a union, or the words as they are."""
    if not base.experiments:
        return [words]
    rest = without(words, "experiment", "experiments")
    without_union = compose(rest)
    for key in (each.name for each in fields(Config)):  # what a union says would hold for none of its parts
        if key not in OF_A_UNION and getattr(base, key) != getattr(without_union, key):
            raise ConfigError(
                f"{key}: an experiment with `experiments` sets {', '.join(OF_A_UNION)} alone; put {key} "
                "into the experiments that it names"
            )
    made, of_all = [], without(rest, "dataset", "datasets")
    for name in base.experiments:
        made.append((f"experiment={name}", *base.common_overrides, *of_all))
        if compose(made[-1]).experiments:
            raise ConfigError(f"experiments: expected single experiments, got {name}, which has several")
    return made


def named(words: Words) -> list[str]:
    """Return the data sets that the words name."""
    if any(word.startswith("datasets=") for word in words):
        return compose(words).datasets
    return [word.partition("=")[2] for word in words if word.startswith("dataset=")][-1:]


def without(words: Words, *keys: str) -> Words:
    """Return the words that do not set one of some keys."""
    return tuple(word for word in words if word.partition("=")[0] not in keys)


def apart(words: Words) -> tuple[Words, dict[str, Words]]:
    """Return the words for all data sets, and those that are aimed at one, by its name."""
    known = {*members("dataset")} - {each.name for each in fields(Dataset)}
    plain: list[str] = []
    aimed: dict[str, Words] = {}
    for word in words:
        match = AIMED.fullmatch(word)
        if match is None or match[1] not in known:
            plain.append("~sweeps" if word in NO_SWEEPS else word)
            continue
        is_of_all = match[3] in (each.name for each in fields(Config))
        aimed[match[1]] = (*aimed.get(match[1], ()), match[2] if is_of_all else f"dataset.{match[2]}")
    return tuple(plain), aimed
