"""Where each committed result comes from, and which are of older code than this source tree.

`python -m benchmarks.results` lists those of older code; given files, it names the modules that have changed
since then. `--mark` puts a dagger behind each link to one in README.md and docs. Results of
`python -m benchmarks` and pictures of `tools.pictures` enter themselves. Any other result is entered by

    python -m benchmarks.results FILE --command "texgs run ..." --code "views surfels shading texture"

right after it was measured; `--revision` names the commit if the code has changed in the meantime. After a
change that keeps the bits of what is measured, as files of both have shown, `--same COMMIT FILE...` says that
results of the code of a commit are of this source tree, too; the column `same` keeps which tree that was.

`benchmarks/results/index.csv` has a row for each. Its column `code` names what was measured: stages, kinds of
field and methods of editing by their names, other modules by their whole names; or the result that a picture
is drawn from. A row without a digest was measured with code of another layout, or not of one commit. A name
of code that is no longer here leads nowhere: such a result is of older code.
"""

import argparse
import re
import shlex
import subprocess
import sys
import tarfile
import tempfile
from io import BytesIO
from itertools import chain
from pathlib import Path

import pandas as pd

from texgs.core.cache import digest
from texgs.workflow.code import code_of, source

ROOT = Path(__file__).parents[1]
RESULTS, DOCS = ROOT / "benchmarks" / "results", ROOT / "docs"
INDEX = RESULTS / "index.csv"
# Of short names; a module may have several methods.
ROOMS = ("fitting", "fields")
PLACES = ("workflow.stages", *ROOMS, *(f"{each}.kinds" for each in ROOMS), "edit.methods", "metrics.edits")
SHARED = {
    **dict.fromkeys(("arf", "stylerf", "stylesplat"), "texgs.edit.methods.style_baselines"),
    **dict.fromkeys(("dge", "igs2gs", "in2n"), "texgs.edit.methods.updates"),
}
ABOUT = "accuracy.md"  # explains the mark
LINK = re.compile(r"(\]\((?:[^)\s]*/)?([\w.-]+)\))(?:†|\[†\]\([^)]*\))?")


def index() -> pd.DataFrame:
    """Return the rows of the index, by their files."""
    return pd.read_csv(INDEX, index_col="file", dtype=str, keep_default_na=False)


def parts(code: str, root: Path | None = None) -> dict[str, str]:
    """Return the digests of the modules that a column `code` leads to; none where a name leads nowhere."""
    root = root or ROOT
    names = [
        [*(f"texgs.{place}.{name}" for place in PLACES), SHARED.get(name, name)] for name in code.split()
    ]
    found = [[each for each in some if source(each, root)] for some in names]
    return code_of(chain.from_iterable(found), root) if all(found) else {}


def parts_at(code: str, revision: str) -> dict[str, str]:
    """Return those of a commit; none where this clone lacks it."""
    words = ("git", "archive", revision.removeprefix("before ").removesuffix("-dirty"), "texgs", "benchmarks")
    done = subprocess.run(words, cwd=ROOT, capture_output=True, check=False)
    with tempfile.TemporaryDirectory() as folder:
        if done.returncode == 0:
            with tarfile.open(fileobj=BytesIO(done.stdout)) as archive:
                archive.extractall(folder, filter="data")
        return parts(code, Path(folder))


def digest_of(found: dict[str, str]) -> str:
    """Return one digest of all; nothing where there is none."""
    return digest("\n".join(f"{name} {each}" for name, each in sorted(found.items()))) if found else ""


def older(rows: pd.DataFrame) -> list[str]:
    """Return the results of other code than this source tree, and the pictures drawn from one of them."""
    results = rows[~rows.code.isin(rows.index)]  # the others are pictures of one of these
    found = {
        file for file, row in results.iterrows() if not row.digest or row.digest != digest_of(parts(row.code))
    }
    return sorted(file for file in rows.index if found & {file, rows.code[file]})


def changed(code: str, revision: str) -> list[str]:
    """Return the names of the modules that have changed since a commit."""
    before, after = parts_at(code, revision), parts(code)
    names = sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))
    return names if before else ["(the code had another layout, or this clone lacks the commit)"]


def add(path: Path, command: str, code: str, revision: str = "") -> None:
    """Enter a result or a picture, in place of the row that it has; by default it is of this source tree."""
    from benchmarks import machine  # loads torch

    rows = index()
    if not path.is_file():
        sys.exit(f"expected a file of results or a picture, got {path}")
    if code not in rows.index and not parts(code):
        sys.exit(f"--code: expected stages, kinds of field, methods, modules or a result, got {code!r}")
    commit = revision or machine.revision().removesuffix("-dirty")
    committed = digest_of(parts_at(code, commit))
    if revision and not committed:
        sys.exit(f"--revision: expected a commit of this clone that has {code}, got {revision}")
    found = committed if revision else digest_of(parts(code))
    commit += "-dirty" if found != committed else ""
    rows.loc[path.name] = [command, machine.processor(), commit, code, found, ""]
    rows.sort_index().to_csv(INDEX, lineterminator="\n")


def keep(names: list[str], before: str) -> None:
    """Enter that results of the code of a commit are those of this source tree, bit for bit."""
    from benchmarks import machine

    rows = index()
    for name in names:
        code = rows.code[name]
        if not rows.digest[name] or rows.digest[name] != digest_of(parts_at(code, before)):
            sys.exit(f"--same: expected results of the code of {before}, got {name}; measure it again")
        rows.loc[name, ["digest", "same"]] = [digest_of(parts(code)), machine.revision()]
    rows.to_csv(INDEX, lineterminator="\n")


def note(path: str | Path, code: str) -> None:
    """Enter a result of the program that runs, if it was written to the folder of results."""
    if Path(path).resolve().parent == RESULTS:
        program = sys.modules["__main__"].__spec__.name.removesuffix(".__main__")  # type: ignore[union-attr]
        add(Path(path), f"python -m {shlex.join([program, *sys.argv[1:]])}", code)


def marked(page: Path, names: list[str]) -> str:
    """Return the text of a page with a dagger behind each link to one of these files, and no other."""
    there = ABOUT if page.parent == DOCS else f"docs/{ABOUT}"
    dagger = "†" if page.name == ABOUT else f"[†]({there})"
    return LINK.sub(lambda link: link[1] + dagger * (link[2] in names), page.read_text(encoding="utf-8"))


def pages() -> list[Path]:
    """Return the README and the pages of docs."""
    return [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]


def main() -> None:
    """List, mark or enter results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path, help="results whose changed modules are named")
    parser.add_argument("--mark", action="store_true", help="mark results of older code in the documentation")
    parser.add_argument("--command", default="not kept", help="that made the result to enter")
    parser.add_argument("--code", help="what it measures, see above; enters it")
    parser.add_argument("--revision", default="", help="commit of it; default: this source tree")
    parser.add_argument("--same", metavar="COMMIT", help="whose code made the same, bit for bit; enters that")
    given = parser.parse_args()
    for path in given.files if given.code else ():
        add(path, given.command, given.code, given.revision)
    rows, names = index(), [path.name for path in given.files]
    if unknown := sorted(set(names) - set(rows.index)):
        parser.error(f"expected files of {INDEX.name}, got {', '.join(unknown)}")
    if given.same:
        keep(names, given.same)
        rows = index()
    found = older(rows)
    for page in pages() if given.mark else ():
        page.write_text(marked(page, found), encoding="utf-8")
    for name in names or found:
        print(name, rows.revision[name], *(changed(rows.code[name], rows.revision[name]) if names else ()))
    print(f"{len(found)} of {len(rows)} results and pictures are of older code")


if __name__ == "__main__":
    main()
