"""What a run says: a line for each job that has ended, and on a terminal bars of the run and of jobs at work.

A logger plugin of Snakemake, which reads the logs of jobs. Those of a cluster have no bars: most are waiting.
"""

import re
import sys
from pathlib import Path
from time import time
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Column, Table
from rich.text import Text
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

from texgs.core.errors import TexgsError
from texgs.core.io import read_json
from texgs.core.names import METRICS
from texgs.core.progress import LINE, time_text
from texgs.workflow.stage_table import RULES

NO_JOBS = {"total", "all", "downloads", *(each.target for each in RULES.values())}  # of Snakemake's counts
OF_NO_USE = "Assuming|Building|Using|Singularity|Select|Shutting|Exiting|Removing|Cannot|Rule.*:\nCalled"
BARS = re.compile(rf"(?m)^.*(?:{LINE}|\d%\|.*$)\n?")  # of texgs and of libraries, in a log


class LogHandler(LogHandlerBase):
    """The plugin. Snakemake calls it in a thread of its own."""

    writes_to_stream = has_filter = has_formatter = True
    writes_to_file = needs_rulegraph = False

    def __post_init__(self) -> None:
        """Prepare the bars."""
        self._jobs: dict[int, Any] = {}  # at work, as Snakemake tells of them
        self._done, self._total, self._start = 0, 0, time()
        console = Console(stderr=True, force_terminal=sys.stderr.isatty())
        self._live = Live(get_renderable=self._bars, console=console, transient=True, redirect_stdout=False)

    def emit(self, record: Any) -> None:
        """Say what has happened; where it cannot be said, the run goes on, and so does its log."""
        event = getattr(record, "event", None)
        try:
            if event == LogEvent.RUN_INFO:
                self._total = sum(record.stats[rule] for rule in record.stats.keys() - NO_JOBS)
            elif event == LogEvent.JOB_INFO and record.rule_name not in NO_JOBS:
                self._jobs[record.jobid] = record
                if record.local and self._live.console.is_terminal:
                    self._live.start()
                else:
                    say("", title(record), "started")
            elif event == LogEvent.JOB_FINISHED and (job := self._jobs.pop(record.job_id, None)):
                self._done += 1
                say(f"{self._done} of {self._total}", title(job), outcome(job))
            elif event == LogEvent.JOB_ERROR and (job := self._jobs.pop(record.jobid, None)):
                told = f"{record.rule_msg or ''}\n{BARS.sub('', text_of(record))}".lstrip()
                say("failed", title(job), f"see {' '.join(record.log)}\n{told}")
            elif event in (None, LogEvent.ERROR) and not re.match(OF_NO_USE, record.getMessage()):
                say("", record.getMessage())
        except (OSError, TexgsError):
            self.handleError(record)

    def close(self) -> None:
        """Take the bars away."""
        self._live.stop()
        super().close()

    def _bars(self) -> Table:
        narrow = (Column(no_wrap=True) for _ in range(3))
        table = Table.grid(*narrow, Column(overflow="ellipsis"), padding=(0, 2))
        rows = [("all jobs", self._start, f": {self._done} of {self._total} jobs")]
        at_work = [job for job in list(self._jobs.values()) if job.local]
        rows += [(title(job), job.created, text_of(job)) for job in at_work]
        for name, start, text in rows:
            last = text.rstrip().rpartition("\n")[2]
            count = re.search(r": (\d+) of (\d+) ", last)
            bar = ProgressBar(int(count[2]), int(count[1]), width=20) if count else ""
            table.add_row(name, time_text(time() - start), bar, Text(last.rpartition(": ")[2], no_wrap=True))
        return table


def say(count: str, what: str, text: str = "") -> None:
    """Print lines on stderr, for which bars make room."""
    told = f"{count:>9}  {what:40}  {text}".rstrip().replace("\n", f"\n{'':11}")
    print(told, file=sys.stderr, flush=True)


def title(job: Any) -> str:
    """Return what a job does and of what, such as "shading engine/TF01/quick"."""
    values = {key: value for key, value in job.wildcards.items() if (key, value) != ("views", "views")}
    return f"{values.pop('phase', job.rule_name).replace('_', ' ')} {'/'.join(values.values())}"


def text_of(job: Any) -> str:
    """Return the log of a job so far."""
    return "".join(Path(log).read_text("utf-8", "replace") for log in job.log if Path(log).is_file())


def outcome(job: Any) -> str:
    """Return quality and time of a job that has ended, and lines that it has said, but for tables."""
    folders = [Path(file).parent for file in job.output if METRICS in file]
    made = read_json(folders[0] / METRICS) if folders else {"seconds": time() - job.created, "numbers": {}}
    quality = f"{made['numbers']['psnr']:.2f} dB, " if "psnr" in made["numbers"] else ""
    said = BARS.sub("", text_of(job)) if folders else "\n".join(re.findall("(?m)^Left out: .*", text_of(job)))
    spent = min(made["seconds"], time() - job.created)  # what was there already took its time before
    return f"{quality}{time_text(spent)}\n{said}"
