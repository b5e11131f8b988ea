"""series.json: the steps of a series in time; volumes and models lie beside it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from texgs.core.errors import ArgumentError
from texgs.core.io import read_json, reading_as, write_json
from texgs.core.names import label, part_file

FORMAT, VERSION = "texgs-series", 1
MAX_STEPS = 100_000  # steps


@dataclass(frozen=True)
class Series:
    """The steps of a series, from 0 on, and the models that follow it."""

    file: Path
    steps: Sequence[str]  # names of the source files of volumes
    models: Sequence[str]

    def model(self, name: str, step: int) -> Path:
        """Return the file of a step of a model, see `at_step`."""
        return self.file.with_name(part_file("models", name, f"{step:05d}"))

    def volume(self, step: int) -> Path:
        """Return the prepared volume of a step."""
        return self.file.with_name(f"volume-{step:05d}.nrrd")


def write_series(series: Series) -> Path:
    """Create or replace its file in one step."""
    values = {FORMAT: VERSION, "steps": list(series.steps), "models": list(series.models)}
    return write_json(series.file, values)


def read_series(path: Path) -> Series:
    """Read a file of `write_series`."""
    values = read_json(path)
    with reading_as("steps and models of a series", "make it again", where=f"{path}: "):
        if values[FORMAT] != VERSION or not 0 < len(values["steps"]) <= MAX_STEPS or not values["models"]:
            raise ArgumentError(
                f"{path}: expected {FORMAT} {VERSION} with 1 to {MAX_STEPS} steps, and models"
            )
        names = [[label(str(path), each) for each in [*values[key]]] for key in ("steps", "models")]
    return Series(path, *names)
