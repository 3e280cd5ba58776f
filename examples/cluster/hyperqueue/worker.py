"""A worker of HyperQueue in a process of its own, by the Python API alone: for where there is no `hq worker start`.

    python worker.py SERVER_DIR

The API starts workers as threads of the process that has the server, and they end with it. This one has a server of
its own that nobody uses, and points its folder to the other server before its worker reads it. `examples/cluster/check`
kills such workers.
"""

import sys
import tempfile
import threading
from pathlib import Path

from hyperqueue import LocalCluster
from hyperqueue.cluster import WorkerConfig


def main():
    server = Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as own, LocalCluster(own) as cluster:
        current = Path(own) / "hq-current"
        current.unlink()
        current.symlink_to((server / "hq-current").resolve())
        cluster.start_worker(WorkerConfig(cores=1))
        threading.Event().wait()


if __name__ == "__main__":
    main()
