"""Compare two folders of results: files, numbers and models have to be equal, times and memory aside.

python tools/compare_results.py BEFORE AFTER
"""

import argparse
import hashlib
import json
import sys
from pathlib import Path

TIMES = ("seconds", "_ms", "milliseconds", "minutes", "peak_memory", "run", "git_sha")
NOT_COMPARED = ("logs", "tables", "mlartifacts", "report.html", "mlflow.db")


def without_times(value: object) -> object:
    """Numbers of a job that are the same each time."""
    if isinstance(value, dict):
        kept = [key for key in value if not any(word in key for word in TIMES)]
        return {key: without_times(value[key]) for key in kept}
    return value


def contents(results: Path) -> dict[str, str]:
    """Digests of all files that have to be equal, by their paths."""
    digests = {}
    for path in sorted(results.rglob("*")):
        name = path.relative_to(results).as_posix()
        hidden = any(part.startswith(".") for part in path.relative_to(results).parts)
        if not path.is_file() or hidden or name.startswith(NOT_COMPARED) or path.name == "times.json":
            continue
        data = path.read_bytes()
        if path.name == "metrics.json":
            data = json.dumps(without_times(json.loads(data)["numbers"]), sort_keys=True).encode()
        digests[name] = hashlib.sha256(data).hexdigest()
    return digests


def different(before: Path, after: Path) -> list[str]:
    """Return the paths of files that are not the same in both folders, or are in one of them alone."""
    one, two = contents(before), contents(after)
    return sorted(name for name in one.keys() | two.keys() if one.get(name) != two.get(name))


def main() -> int:
    """Compare, and print what differs; 1 if anything does."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    arguments = parser.parse_args()
    names = different(arguments.before, arguments.after)
    print("\n".join(names) or f"{len(contents(arguments.before))} files are equal")
    return int(bool(names))


if __name__ == "__main__":
    sys.exit(main())
