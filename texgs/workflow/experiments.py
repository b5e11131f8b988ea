"""What an experiment runs: a configuration for each data set, recipe, variant of a sweep and edit."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields

from texgs.config.compose import compose
from texgs.config.dataset import Dataset
from texgs.config.project import members
from texgs.config.schema import Config
from texgs.core.errors import ConfigError
from texgs.core.names import close
from texgs.edit.method import method_of
from texgs.workflow.edits import edits
from texgs.workflow.stage import edit_folder
from texgs.workflow.stage_table import STAGES
from texgs.workflow.sweep import variants
from texgs.workflow.variants import changes, is_of_edits

Words = tuple[str, ...]
OF_A_UNION = ("experiments", "each", "aimed", "missing")  # all that an experiment of experiments sets
NO_SWEEPS = ("sweeps={}", "sweeps=null", "sweep=none")  # what is written to switch them off
AIMED = re.compile(r"dataset\.([\w-]+)\.(([\w-]+)[^=]*=.*)", re.DOTALL)  # dataset.NAME.KEY=VALUE


@dataclass(frozen=True)
class LeftOut:
    """What a run goes on without."""

    what: str
    why: str  # one sentence


@dataclass
class Selection:
    """The configurations of a run."""

    lacking: Callable[[Config], Sequence[str]]  # what is not here of what a configuration needs
    skips: bool  # whether what lacks something is left out
    by_sweep: dict[str, list[Config]] = field(default_factory=lambda: defaultdict(list))  # "": of none
    left_out: dict[LeftOut, dict[str, None]] = field(default_factory=dict)  # with the places of its jobs

    def takes(self, config: Config, what: str) -> bool:
        """Whether a configuration is run; what is left out is noted."""
        reasons = self.lacking(config) if self.skips else ()
        for why in reasons:
            places = self.left_out.setdefault(LeftOut(what, why.removeprefix(f"{what}: ")), {})
            places.update(dict.fromkeys(stage.place for stage in STAGES.values() if stage.applies(config)))
        return not reasons

    def add(self, words: Words, several: bool) -> None:
        """Add one data set with one recipe: its fits and its edits, or those of each variant of its sweep.

        Args:
            words: of the data set and the recipe.
            several: whether it is one of several recipes, of which not each can be edited in every way.
        """
        config = compose((*words, "edit=none"))
        if not self.takes(config, f"data set {config.dataset.name}"):
            return
        listed = self.by_sweep[config.sweep.name if changes(config) else ""]
        for each in variants(words):
            edited, left = self.edited(each, several)
            if is_of_edits(config) and not edited:
                continue  # the fits alone are no variant of it
            own: Words = ()
            if left != list(compose(each).edits):  # a gallery then shows what is left
                own = f"edits=[{','.join(left)}]", "gallery.grids=[]"
            listed += [compose((*each, *own, "edit=none")), *edited]

    def edited(self, words: Words, several: bool) -> tuple[list[Config], list[str]]:
        """The edits of a data set that are possible and lack nothing, and what `edits` has left of them."""
        made: dict[str, Config] = {}
        gone: set[str] = set()
        for config in map(compose, edits(words)):
            name, base = config.edit.name, config.edit.base
            if base in gone or not self.takes(config, f"edit {edit_folder(config)}"):
                gone.add(name)
            elif not several or method_of(config.edit).takes(config.fit.field):
                made[name] = config
        return list(made.values()), [name for name in compose(words).edits if name not in gone]


def selected(words: Words, lacking: Callable[[Config], Sequence[str]]) -> Selection:
    """The configurations that some words describe.

    Words of the form dataset.NAME.KEY=VALUE hold for one data set of the run. A data set that the words name
    wins over the list of the experiment.

    Args:
        words: overrides of the configuration.
        lacking: sentences that tell what is not on this machine of what a configuration needs.

    Raises:
        ConfigError: for a name twice in a list, a data set that the run has not, or an experiment of
            experiments that sets more than these.
    """
    plain, aimed = apart(words)
    base = compose(plain)
    selection = Selection(lacking, skips(plain, base))
    reached: set[str] = set()
    of_union = base.aimed if base.experiments else {}
    for part in parts(plain, base):
        reached |= add_part(part, joined(of_union, aimed), selection)
    if beside := [name for name in aimed if name not in reached]:
        raise ConfigError(
            f"dataset.{beside[0]}: expected one of the data sets of this run, {', '.join(sorted(reached))}; "
            f"got {beside[0]}"
        )
    return selection


def add_part(words: Words, aimed: Mapping[str, Words], selection: Selection) -> set[str]:
    """Add one experiment, and return the names of its data sets."""
    base = compose(words)
    for key, listed in (("datasets", base.datasets), ("fits", base.fits)):
        if repeated := [name for name in listed if listed.count(name) > 1]:
            raise ConfigError(f"{key}: expected different names, got {repeated[0]} twice")
    names = named(words) or list(base.datasets) or [base.dataset.name]
    is_listed = bool(named(words) or base.datasets)
    aimed = joined(base.aimed, aimed)
    for name in names:
        of_set = (*words, *((f"dataset={name}",) if is_listed else ()), *aimed.get(name, ()))
        for each in [(*of_set, f"fit={fit}") for fit in base.fits] or [of_set]:
            selection.add(each, len(base.fits) > 1)
    of_sweeps = sweeps(words, base)
    beside = (*without(words, "sweep.name", "sweep.over"), "edit=none", "edits=[]")
    for sweep, name in of_sweeps.items():
        selection.add((*beside, f"dataset={name}", *aimed.get(name, ()), f"sweep={sweep}"), False)
    return {*names, *of_sweeps.values()}


def joined(aimed: Mapping[str, Sequence[str]], later: Mapping[str, Sequence[str]]) -> dict[str, Words]:
    """The words that are aimed at each data set, first those of an experiment."""
    known = members("dataset")
    if unknown := [name for name in aimed if name not in known]:
        raise ConfigError(f"aimed: expected names of data sets, got {unknown[0]}{close(unknown[0], known)}")
    return {name: (*aimed.get(name, ()), *later.get(name, ())) for name in {*aimed, *later}}


def parts(words: Words, base: Config) -> list[Words]:
    """The words of each experiment of a union, or the words as they are."""
    if not base.experiments:
        return [words]
    rest = without(words, "experiment", "experiments")
    require_union(base, compose(rest))
    wanted, made = named(words), []
    of_all = without(rest, "dataset", "datasets")
    for name in base.experiments:
        part = compose((f"experiment={name}", *base.each, *of_all))
        if part.experiments:
            raise ConfigError(f"experiments: expected single experiments, got {name}, which has several")
        own = list(part.datasets) or [part.dataset.name]
        own_words = f"experiment={name}", *base.each
        if not wanted:
            made.append((*own_words, *rest))
        elif chosen := [each for each in own if each in wanted]:
            of_set = f"datasets=[{','.join(chosen)}]"
            made.append((*own_words, *of_all, of_set))
    if not made:
        raise ConfigError(
            f"dataset: expected data sets of {', '.join(base.experiments)}, got {', '.join(wanted)}"
        )
    return made


def require_union(union: Config, plain: Config) -> None:
    """Require of an experiment of experiments that it says nothing else: it would hold for none of them."""
    for key in (each.name for each in fields(Config)):
        if key not in OF_A_UNION and getattr(union, key) != getattr(plain, key):
            raise ConfigError(
                f"{key}: an experiment with `experiments` sets {', '.join(OF_A_UNION)} alone; put {key} "
                "into the experiments that it names"
            )


def sweeps(words: Words, base: Config) -> dict[str, str]:
    """The data sets of the sweeps beside an experiment, by the names of the sweeps.

    Where the words name data sets and no sweeps, those of other data sets are not run.
    """
    wanted = named(words)
    if not wanted or any(word.startswith("sweeps") for word in words):
        return dict(base.sweeps)
    return {sweep: name for sweep, name in base.sweeps.items() if name in wanted}


def skips(words: Words, base: Config) -> bool:
    """Whether what is missing is left out; a data set that the words name is not, unless they say so."""
    is_asked_for = any(word.startswith("missing=") for word in words)
    return bool(base.missing == "skip" and (is_asked_for or not named(words)))


def named(words: Words) -> list[str]:
    """The data sets that the words name."""
    single = [word.partition("=")[2] for word in words if word.startswith("dataset=")]
    if any(word.startswith("datasets=") for word in words):
        return list(compose(words).datasets)
    return single[-1:]


def without(words: Words, *keys: str) -> Words:
    """The words that do not set one of some keys."""
    return tuple(word for word in words if word.partition("=")[0] not in keys)


def apart(words: Words) -> tuple[Words, dict[str, Words]]:
    """The words for all data sets, and those that are aimed at one, by its name."""
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
