"""A stand-in for Slurm on this machine: `sbatch` starts a job's script at once, `scancel` ends it.

The number of a job is the id of its process group. The folder of the commands keeps a file for each
job, with its output.
"""

import os
import signal
import sys
from contextlib import suppress
from pathlib import Path

COMMAND = """#!{python}
import os, signal, subprocess, sys
from pathlib import Path

if sys.argv[0].endswith("scancel"):
    try:
        os.killpg(int(sys.argv[1]), signal.SIGTERM)
    except ProcessLookupError:
        sys.exit("scancel: error: Kill job error on job id " + sys.argv[1])
    sys.exit()
if "--test-only" in sys.argv:
    sys.exit()
folder = Path({folder!r})
script = Path(sys.argv[-1]).read_text()
log = (folder / ("starting-" + str(os.getpid()))).open("w")
job = subprocess.Popen(["bash", "-c", script], start_new_session=True, stdout=log, stderr=log)
Path(log.name).rename(folder / ("slurm-" + str(job.pid) + ".out"))
print("Submitted batch job", job.pid)
"""


class FakeSlurm:
    """The commands of Slurm in a folder, which is to be the first of the PATH."""

    def __init__(self, folder: Path):
        self.folder = folder
        for name in ("sbatch", "scancel"):
            command = folder / name
            command.write_text(COMMAND.format(python=sys.executable, folder=str(folder)))
            command.chmod(0o755)

    def jobs(self) -> list[int]:
        """Return the numbers of all jobs that were submitted."""
        return [int(file.stem.partition("-")[2]) for file in self.folder.glob("slurm-*.out")]

    def kill(self, job: int) -> None:
        """End a job and all its processes at once, as a machine that fails does."""
        with suppress(ProcessLookupError):
            os.killpg(job, signal.SIGKILL)

    def running(self) -> list[int]:
        """Return the numbers of the jobs that have processes."""
        return [job for job in self.jobs() if _is_running(job)]


def _is_running(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True
