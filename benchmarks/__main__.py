"""`python -m benchmarks`: measure speed and memory on this machine, print tables, write JSON."""

import json
import sys
from dataclasses import asdict
from importlib import import_module

from benchmarks import machine, report
from benchmarks.results import RESULTS, note
from benchmarks.settings import SECTIONS, Settings, parse
from texgs.core.errors import TexgsError


def main() -> int:
    """Run the sections in turn; what is measured so far is on disk after each."""
    try:
        settings = parse()
        results = {"machine": machine.describe(settings.device), "settings": _plain(settings), "sections": {}}
        path = settings.json or RESULTS / f"{results['machine']['date'][:10]}-{settings.device.type}.json"
        for name in SECTIONS:
            results["sections"][name] = _measure(name, settings)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    except TexgsError as error:
        print(error, file=sys.stderr)
        return 1
    note(path, " ".join(f"benchmarks.{name}" for name in settings.sections))
    print(f"\nWrote {path}")
    return 0


def _measure(name: str, settings: Settings) -> dict:
    """One section as JSON, shown on the screen as well."""
    if name not in settings.sections:
        return {"measurements": [], "skipped": [{"name": name, "reason": "not in --sections"}]}
    with machine.Load() as load:
        section = import_module(f"benchmarks.{name}").run(settings)
    report.show(name, section)
    print(f"{name}: {load}")
    return {"load": asdict(load)} | asdict(section)


def _plain(settings: Settings) -> dict:
    """The settings as JSON can hold them."""
    return vars(settings) | {name: str(getattr(settings, name)) for name in ("device", "json")}


if __name__ == "__main__":
    sys.exit(main())
