"""The cases of a run: what the words that a user types come to, in one pass.

    words -> experiments of a union -> data sets -> recipes -> variants and seeds of a sweep -> edits

Keys with several values have become a sweep before, see `as_sweep`. Each step gives the cases of the one
before it more words, and the last word on a key wins; only the experiments of a union start from words of
their own. What lacks data or weights on this machine is replaced by what stands in for it, left out, or kept
for the plan to stop at, as the experiment says.
"""

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields

from texgs.config.case import Case
from texgs.config.dataset import Dataset
from texgs.config.project import Words, members
from texgs.config.schema import Config, StandIns
from texgs.core.errors import ConfigError
from texgs.core.names import close
from texgs.edit.method import method_of
from texgs.workflow.edits import edits_of
from texgs.workflow.stage import edit_folder
from texgs.workflow.stage_table import STAGES
from texgs.workflow.stand_ins import Choice, Lacking, check_stand_ins, chosen_data_set, chosen_edit
from texgs.workflow.sweep import is_of_edits, variant_words, variants

OF_A_UNION = ("experiments", "common_overrides", "per_dataset", "on_missing")  # keys that a union may set
NO_SWEEPS = ("sweeps={}", "sweeps=null", "sweep=none")  # how users switch sweeps off
AIMED = re.compile(r"dataset\.([\w-]+)\.(([\w-]+)[^=]*=.*)", re.DOTALL)  # dataset.NAME.KEY=VALUE
WordsOf = dict[str, Words]  # words for one data set alone, by its name


@dataclass(frozen=True)
class LeftOut:
    """What a run goes on without."""

    what: str
    why: str  # one sentence


@dataclass
class Cases:
    """The cases of a run by the name of their sweep, and what it goes on without."""

    case: Case  # the user's words alone
    lacking: Lacking
    skips: bool  # whether cases that lack something are left out
    by_sweep: dict[str, list[Case]] = field(default_factory=lambda: defaultdict(list))  # "": of no sweep
    left_out: dict[LeftOut, dict[str, None]] = field(default_factory=dict)  # with the places of its jobs

    @property
    def config(self) -> Config:
        """The configuration of the user's words alone, such as where results go."""
        return self.case.config

    @property
    def configs(self) -> list[Config]:
        """The configurations of all cases."""
        return [case.config for cases in self.by_sweep.values() for case in cases]

    def add_experiment(self, case: Case, wanted: Sequence[str], aimed: WordsOf) -> set[str]:
        """Add the data sets and sweeps of one experiment, and return the names of these data sets.

        Args:
            case: the words of the experiment.
            wanted: the data sets that the user names; an experiment takes those of them that are its own.
            aimed: the user's words for single data sets.
        """
        config = case.config
        check_lists(config)
        self.note_lists(case, config)
        listed, aimed = (
            named_data_sets(case) or config.datasets,
            merge_words(self.unsaid(config.per_dataset), aimed),
        )

        def of(name: str) -> Case:
            return case.but(f"dataset={name}", *aimed.get(name, ()))

        def choose(name: str) -> Choice:
            keys = StandIns() if name in wanted else config.stand_ins
            return chosen_data_set(keys, name, lambda other: self.lacking(of(other).unedited.config))

        choices: dict[str, list[Choice]] = defaultdict(list)  # by the data set that is taken
        for choice in map(choose, listed or [config.dataset.name]):
            if not wanted or choice.taken in wanted:
                choices[choice.taken].append(choice)
        names = config.edits if case.says("edits") is None else []
        edits = [chosen_edit(config.stand_ins, name, case) for name in names]
        for name, own in choices.items():
            chosen = of(name) if listed else case.but(*aimed.get(name, ()))
            chosen = chosen.but(*self.note_choices(own, edits))
            for recipe in [chosen.but(f"fit={fit}") for fit in config.fits] or [chosen]:
                self.add_recipe(recipe, is_one_of_several=len(config.fits) > 1)
        # Where the user names data sets and no sweeps, the sweeps of other data sets are not run.
        takes_all = choices and (not wanted or any(word.startswith("sweeps") for word in case.words))
        of_sweeps = {sweep: choose(name).taken for sweep, name in config.sweeps.items()}
        of_sweeps = {sweep: name for sweep, name in of_sweeps.items() if takes_all or name in choices}
        for sweep, name in of_sweeps.items():
            words = f"dataset={name}", *aimed.get(name, ()), f"sweep={sweep}"
            self.add_recipe(case.without("sweep.name", "sweep.over").but("edit=none", "edits=[]", *words))
        return {*choices, *of_sweeps.values()}

    def unsaid(self, per_dataset: Mapping[str, Sequence[str]]) -> WordsOf:
        """Return the words of an experiment for single data sets, without keys that the user's words set."""
        return {
            name: tuple(word for word in words if self.case.says(word.partition("=")[0]) is None)
            for name, words in per_dataset.items()
        }

    def note_lists(self, case: Case, config: Config) -> None:
        """Note a single recipe or edit of the user that does not replace the list of an experiment."""
        for key, listed in (("fit", config.fits), ("edit", config.edits)):
            name = self.case.says(key)
            if listed and name not in (None, "none", *listed) and self.case.says(f"{key}s") is None:
                of = case.says("experiment") or "this experiment"
                why = f"{of} lists {', '.join(listed)} in `{key}s`; {key}s=[{name}] replaces them"
                self.left_out.setdefault(LeftOut(f"{key}={name}", why), {})

    def note_choices(self, datasets: Sequence[Choice], edits: Sequence[Choice]) -> Words:
        """Note what is replaced because it lacks something; return words for the edits and captions."""
        from texgs.config.composition import quoted

        for each in (*datasets, *edits):
            for why in each.lacks:
                reason = why.removeprefix(f"{each.what}: ").rstrip(". ")
                self.left_out.setdefault(LeftOut(each.what, f"{reason}; `{each.taken}` stands in for it"), {})
        captions = " ".join(filter(None, (each.caption for each in (*datasets, *edits))))
        if not captions:
            return ()
        names = ",".join(dict.fromkeys(each.taken for each in edits))
        return (*((f"edits=[{names}]",) if edits else ()), f"gallery.note={quoted(captions)}")

    def add_recipe(self, case: Case, *, is_one_of_several: bool = False) -> None:
        """Add the fit and the edits of a data set with one recipe, or those of each variant of its sweep.

        Of several recipes not each can be edited in every way.
        """
        config = case.unedited.config
        if not self.takes(config, f"data set {config.dataset.name}"):
            return
        cases = self.by_sweep[config.sweep.name if variant_words(config) else ""]
        edited = [(each, *self.possible_edits(each, is_one_of_several)) for each in variants(case)]
        if len({len(edits) for _, edits, _ in edited}) > 1:
            return  # some variants alone compare nothing, and a gallery shows all
        for variant, edits, names in edited:
            if is_of_edits(config) and not edits:
                continue  # the fits alone are no variant of it
            if names != variant.config.edits:  # a gallery shows those that are left
                variant = variant.but(f"edits=[{','.join(names)}]", "gallery.grids=[]")
            cases += [variant.unedited, *edits]

    def possible_edits(self, case: Case, is_one_of_several: bool) -> tuple[list[Case], list[str]]:
        """Return the edits that are possible and lack nothing, and what `edits` has left of them."""
        possible: list[Case] = []
        gone: set[str] = set()
        for each in edits_of(case):
            edit, kind = each.config.edit, each.config.fit.field
            if edit.base in gone or not self.takes(each.config, f"edit {edit_folder(each.config)}"):
                gone.add(edit.name)
            elif not is_one_of_several or method_of(edit).takes(kind):
                possible.append(each)
        return possible, [name for name in case.config.edits if name not in gone]

    def takes(self, config: Config, what: str) -> bool:
        """Return whether a case is run; note what is left out."""
        reasons = self.lacking(config) if self.skips else ()
        for why in reasons:
            places = self.left_out.setdefault(LeftOut(what, why.removeprefix(f"{what}: ")), {})
            places.update(dict.fromkeys(stage.place for stage in STAGES.values() if stage.applies(config)))
        return not reasons


def cases_of(words: Words, lacking: Lacking) -> Cases:
    """Return the cases that a user's words come to.

    A word such as dataset.NAME.KEY=VALUE holds for one data set of the run. A data set that the words name
    wins over the list of the experiment, and is not left out where it lacks something, unless they say so.

    Args:
        words: of the user.
        lacking: gives a sentence for each thing that a configuration needs and this machine does not have.

    Raises:
        ConfigError: naming the word or the key of an experiment that is wrong.
    """
    case, aimed = split_aimed(words)
    config, wanted = case.config, named_data_sets(case)
    skips = config.on_missing == "skip" and (not wanted or case.says("on_missing") is not None)
    cases, names = Cases(case, lacking, skips), set[str]()
    of_union = cases.unsaid(config.per_dataset) if config.experiments else {}
    per_dataset = merge_words(of_union, aimed)
    for experiment in experiments_of(case):
        names |= cases.add_experiment(experiment, wanted, per_dataset)
    if not names:
        expected = ", ".join(config.experiments)
        raise ConfigError(f"dataset: expected data sets of {expected}, got {', '.join(wanted)}")
    if other := next((name for name in aimed if name not in names), None):
        raise ConfigError(
            f"dataset.{other}: expected one of the data sets of this run, {', '.join(sorted(names))}; "
            f"got {other}"
        )
    return cases


def split_aimed(words: Words) -> tuple[Case, WordsOf]:
    """Return the words for all data sets as a case, and the words for single data sets."""
    known = {*members("dataset")} - {each.name for each in fields(Dataset)}
    shared: list[str] = []
    aimed: WordsOf = {}
    for word in words:
        match = AIMED.fullmatch(word)
        if match is None or match[1] not in known:
            shared.append("~sweeps" if word in NO_SWEEPS else word)
            continue
        is_of_all = match[3] in (each.name for each in fields(Config))
        aimed[match[1]] = (*aimed.get(match[1], ()), match[2] if is_of_all else f"dataset.{match[2]}")
    return Case(tuple(shared)), aimed


def experiments_of(case: Case) -> list[Case]:
    """Return each experiment of a union; what is no union is one experiment."""
    config = case.config
    if not config.experiments:
        return [case]
    rest = case.without("experiment", "experiments")
    for key in (each.name for each in fields(Config)):  # no experiment would have what a union says of others
        if key not in OF_A_UNION and getattr(config, key) != getattr(rest.config, key):
            raise ConfigError(
                f"{key}: an experiment with `experiments` sets {', '.join(OF_A_UNION)} alone; put {key} "
                "into the experiments that it names"
            )
    own = config.common_overrides, rest.without("dataset", "datasets").words
    experiments = [Case((f"experiment={name}", *own[0], *own[1])) for name in config.experiments]
    if union := next((each for each in experiments if each.config.experiments), None):
        raise ConfigError(
            f"experiments: expected single experiments, got {union.says('experiment')}, which has several"
        )
    return experiments


def named_data_sets(case: Case) -> list[str]:
    """Return the data sets that the words name."""
    if case.says("datasets") is not None:
        return case.config.datasets
    name = case.says("dataset")
    return [] if name is None else [name]


def merge_words(first: Mapping[str, Sequence[str]], then: Mapping[str, Sequence[str]]) -> WordsOf:
    """Return words for single data sets, where the second ones win."""
    known = members("dataset")
    if unknown := [name for name in first if name not in known]:
        raise ConfigError(
            f"per_dataset: expected names of data sets, got {unknown[0]}{close(unknown[0], known)}"
        )
    return {name: (*first.get(name, ()), *then.get(name, ())) for name in {*first, *then}}


def check_lists(config: Config) -> None:
    """Require of lists that they name nothing twice, and of stand-ins that there are files of them."""
    for key, listed in (("datasets", config.datasets), ("fits", config.fits)):
        if repeated := [name for name in listed if listed.count(name) > 1]:
            raise ConfigError(f"{key}: expected different names, got {repeated[0]} twice")
    check_stand_ins(config.stand_ins)
