"""A stand-in for Slurm on this machine: `sbatch` starts a job's script at once, `scancel` ends it.

The folder of the commands keeps a file for each job, named after its number, with its process id.
"""

import os
import signal
import sys
from contextlib import suppress
from pathlib import Path

COMMAND = """#!{python}
import os, signal, subprocess, sys
from pathlib import Path

folder = Path({folder!r})
if sys.argv[0].endswith("scancel"):
    try:
        os.killpg(int((folder / sys.argv[1]).read_text()), signal.SIGTERM)
    except ProcessLookupError:
        sys.exit("scancel: error: Kill job error on job id " + sys.argv[1])
    sys.exit()
if "--test-only" in sys.argv:
    if "#SBATCH -n 1" in sys.stdin.read():
        sys.exit()
    sys.exit("sbatch: error: Batch job submission failed: Invalid account")
script = Path(sys.argv[-1]).read_text()
number = str(1 + len([file for file in folder.iterdir() if file.name.isdigit()]))
log = (folder / ("slurm-" + number + ".out")).open("w")
job = subprocess.Popen(["bash", "-c", script], start_new_session=True, stdout=log, stderr=log)
(folder / number).write_text(str(job.pid))
print("Submitted batch job", number)
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
        """Return the process ids of all jobs that were submitted."""
        return [int(file.read_text()) for file in sorted(self.folder.glob("[0-9]*"))]

    def kill(self, job: int) -> None:
        """End a job and all its processes at once, as a machine that fails does."""
        with suppress(ProcessLookupError):
            os.killpg(job, signal.SIGKILL)

    def running(self) -> list[int]:
        """Return the process ids of the jobs that have processes."""
        return [job for job in self.jobs() if _is_running(job)]


def _is_running(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True
