"""A case: words that say what is fitted and edited, and the configuration that they compose."""

from dataclasses import dataclass

from texgs.config.compose import compose
from texgs.config.project import Words
from texgs.config.schema import Config
from texgs.edit.method import NO_METHOD


@dataclass(frozen=True)
class Case:
    """Overrides in Hydra's syntax, such as `dataset=engine` or `fit.seed=3`, and what they compose.

    What a run goes through are cases of one data set with one recipe and one edit or none, perhaps as a
    variant of a sweep with its seeds; on the way there a case may stand for a whole experiment.
    """

    words: Words = ()

    @property
    def config(self) -> Config:
        """Compose the configuration; a ConfigError names the wrong word."""
        return compose(self.words)

    def but(self, *words: str) -> "Case":
        """Return the case with more words; they override earlier ones."""
        return Case((*self.words, *words))

    def without(self, *keys: str) -> "Case":
        """Return the case without the words that set some keys."""
        return Case(tuple(word for word in self.words if word.partition("=")[0] not in keys))

    def edited(self, name: str) -> "Case":
        """Return the case with an edit of conf/edit."""
        return self.but(f"edit={name}")

    @property
    def unedited(self) -> "Case":
        """The case of the fit alone."""
        return self if self.config.edit.method == NO_METHOD else self.edited("none")

    def says(self, key: str) -> str | None:
        """Return the last value that the words give a key, or None."""
        values = [word.partition("=")[2] for word in self.words if word.partition("=")[0] == key]
        return values[-1] if values else None
