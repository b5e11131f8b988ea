"""Write the plan of every experiment to a folder, to compare the plans of two versions of texgs.

python tools/plans.py FOLDER

Each file holds the jobs of one experiment by their folders: stage, settings, input files and swept values. It
also says which jobs belong to which sweep. Digests of code are left out, so that `diff -r BEFORE AFTER`
compares two versions. Empty files stand in for data, so that plans do not depend on the machine.
"""

import argparse
import json
import os
import tempfile
from pathlib import Path

import yaml

from texgs.config.project import ROOT, members
from texgs.workflow.plan import planned, words_of

VIEWS = {"vortex": ("TF01", "TF02", "TF03", "TF04")}  # data sets that start from views, and their TFs
RUNS = {  # beside the experiments: what people type
    "engine": "dataset=engine fit=quick edits=[glass,gold] views.width=200 views.height=200",
    "seeds": "dataset=sphere fit=quick fit.low_pass=2,6 fit.seed=0,1",
    "recipes": "dataset=orbital fits=[quick,gaussians_quick] edits=[style,crimson] edit.seed=3",
    "edit_sweep": "dataset=engine sweep=lambda_s edit=style",
    "aimed": "experiment=paper_quick dataset.engine.views.width=99",
    "chained": "dataset=engine edits=[part,wooden_part,lobe]",
}


def stand_in(folder: Path) -> None:
    """Put an empty file into a folder for each data file that a data set names."""
    for path in (ROOT / "conf" / "dataset").glob("*.yaml"):
        dataset = yaml.safe_load(path.read_text())
        if name := dataset.get("volume", {}).get("file"):
            (folder / name).touch()
    for name, tfs in VIEWS.items():
        for tf in tfs:
            (folder / name / tf).mkdir(parents=True)
            (folder / name / tf / "transforms_train.json").touch()


def plan(words: dict[str, str]) -> dict[str, object]:
    """The plan of one run in plain values, without digests of code and paths of this machine."""
    made, _ = planned(words_of(words), is_job=False)
    jobs = {
        folder: {
            "stage": job["stage"],
            "settings": yaml.safe_load(Path(job["settings"]).read_text()),
            "inputs": job["inputs"],
            "swept": job["swept"],
        }
        for folder, job in made.jobs.items()
    }
    return {"jobs": jobs, "sweeps": made.sweeps}


def main() -> None:
    """Write all plans."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    target = parser.parse_args().folder.absolute()
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        data = Path(temporary, "data")
        data.mkdir()
        stand_in(data)
        os.environ["TEXGS_DATA"] = str(data)
        os.environ["TEXGS_WEIGHTS"] = str(data)
        os.chdir(temporary)
        runs = {name: {"experiment": name, "overrides": "on_missing=stop"} for name in members("experiment")}
        runs |= {name: {"overrides": words} for name, words in RUNS.items()}
        for name, words in runs.items():
            text = json.dumps(plan(words), indent=1, sort_keys=True).replace(str(data), "DATA")
            (target / f"{name}.json").write_text(text)
            print(name)


if __name__ == "__main__":
    main()
