"""A real SLURM with one node, this machine: its daemons on loopback, with all their files in one folder."""

import getpass
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# What the login node and the batch scripts call, and the daemons.
PROGRAMS = ("sbatch", "srun", "squeue", "scancel", "scontrol", "sinfo", "slurmctld", "slurmd", "slurmstepd")

# One node, said to have more cores and memory than it has. No accounting: `squeue` tells how jobs ended.
CONFIGURATION = """
ClusterName=texgs
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller_port}
SlurmdPort={node_port}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/none
CredType=cred/none
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmdParameters=config_overrides
ProctrackType=proctrack/pgid
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SchedulerType=sched/builtin
SchedulerParameters=sched_interval=1,sched_min_interval=0,batch_sched_delay=0
MpiDefault=none
ReturnToService=2
MinJobAge=3600
KillWait=5
GresTypes=gpu
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory={memory} Gres=gpu:1 State=UNKNOWN
PartitionName=main Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""
# A device that can be allocated and does nothing.
GPU = "NodeName={host} Name=gpu File=/dev/zero\n"
# The job step of Snakemake's plugin takes SLURM_CONF out of the environment.
SRUN = '#!/bin/sh\nSLURM_CONF={conf} exec {srun} "$@"\n'


class Slurm:
    """The running cluster."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.programs = folder / "bin"
        self.environment = {
            **os.environ,
            "SLURM_CONF": str(folder / "slurm.conf"),
            "PATH": f"{self.programs}:{Path(sys.executable).parent}:{os.environ['PATH']}",
        }

    def call(self, *words: str) -> str:
        """What a command of SLURM prints."""
        done = subprocess.run(words, env=self.environment, text=True, capture_output=True, timeout=60)
        assert done.returncode == 0, f"{' '.join(words)}: {done.stderr}"
        return done.stdout.strip()

    def jobs(self, *states: str) -> dict[str, str]:
        """Comments of jobs by their numbers: the plugin writes rule and wildcards there."""
        lines = self.call("squeue", "--noheader", f"--states={','.join(states) or 'all'}", "--format=%A %k")
        pairs = (each.partition(" ") for each in lines.splitlines())
        return {number: comment for number, _, comment in pairs}


def missing() -> list[str]:
    """Programs of SLURM that are not installed."""
    return [name for name in PROGRAMS if which(name) is None]


def which(name: str) -> str | None:
    """A program's path; daemons are not on every user's PATH."""
    return shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin:/sbin")


@contextmanager
def running(folder: Path, cores: int = 32, memory: int = 64000) -> Iterator[Slurm]:
    """The cluster as long as the context lasts; afterwards neither a daemon nor a job is left.

    The node says that it has so many cores, and so many MB of memory.
    """
    slurm = Slurm(folder)
    write_configuration(slurm, cores, memory)
    host = socket.gethostname().partition(".")[0]
    commands = (["slurmctld", "-D", "-i"], ["slurmd", "-D", "-N", host])
    daemons: list[subprocess.Popen[bytes]] = []
    try:
        for name, *options in commands:
            with (folder / f"{name}.out").open("wb") as out:
                command = [which(name) or name, *options]
                daemons.append(subprocess.Popen(command, env=slurm.environment, stdout=out, stderr=out))
        wait_until_idle(slurm, daemons)
        yield slurm
    finally:
        stop(slurm, daemons)


def write_configuration(slurm: Slurm, cores: int, memory: int) -> None:
    """Write slurm.conf, gres.conf and the wrapper of srun."""
    folder = slurm.folder
    for each in (folder / "state", folder / "spool", slurm.programs):
        each.mkdir(parents=True)
    host = socket.gethostname().partition(".")[0]
    ports = dict(zip(("controller_port", "node_port"), free_ports(2), strict=True))
    values = {"host": host, "user": getpass.getuser(), "folder": folder, "cores": cores, "memory": memory}
    (folder / "slurm.conf").write_text(CONFIGURATION.format(**values, **ports))
    (folder / "gres.conf").write_text(GPU.format(host=host))
    srun = slurm.programs / "srun"
    srun.write_text(SRUN.format(conf=folder / "slurm.conf", srun=which("srun")))
    srun.chmod(0o755)


def free_ports(count: int) -> list[int]:
    """Ports that nobody listens on."""
    sockets = [socket.socket() for _ in range(count)]
    for each in sockets:
        each.bind(("127.0.0.1", 0))
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


def wait_until_idle(slurm: Slurm, daemons: list[subprocess.Popen[bytes]]) -> None:
    """Wait for the node to be ready for jobs."""
    deadline = time.monotonic() + 30
    said = ""
    while time.monotonic() < deadline and all(daemon.poll() is None for daemon in daemons):
        done = subprocess.run(
            ["sinfo", "--noheader", "--format=%t"], env=slurm.environment, text=True, capture_output=True
        )
        said = done.stdout.strip() or done.stderr.strip()
        if said == "idle":
            return
        time.sleep(0.2)
    logs = "\n".join(path.read_text() for path in sorted(slurm.folder.glob("slurm*.out")))
    raise AssertionError(f"SLURM did not start ({said}):\n{logs}")


def stop(slurm: Slurm, daemons: list[subprocess.Popen[bytes]]) -> None:
    """Cancel what still runs, then end the daemons by their ids."""
    if all(daemon.poll() is None for daemon in daemons) and (left := slurm.jobs("pending", "running")):
        slurm.call("scancel", *left)
        deadline = time.monotonic() + 20
        while slurm.jobs("running", "completing") and time.monotonic() < deadline:
            time.sleep(0.2)
    for daemon in reversed(daemons):
        daemon.terminate()
    for daemon in daemons:
        try:
            daemon.wait(timeout=20)
        except subprocess.TimeoutExpired:
            daemon.kill()
            daemon.wait()


def processes_below(folder: Path) -> list[str]:
    """Command lines of living processes that mention the folder or work in it."""
    commands = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            place = str((process / "cwd").readlink())
        except OSError:  # it has ended meanwhile
            continue
        if int(process.name) != os.getpid() and (str(folder) in words or place.startswith(str(folder))):
            commands.append(words)
    return commands
