"""A data set in parts under HyperQueue, by its Python API: `pip install hyperqueue`.

    python parts.py plan.ron data --parts 8 --workers 2

It starts a server and workers of its own here. On a cluster, start them as HyperQueue's manual says, and give the server's folder
(`--server ~/.hq-server/hq-current`). A task whose worker dies is given to another one.
"""

import argparse
from contextlib import nullcontext
from pathlib import Path

from hyperqueue import Client, Job, LocalCluster
from hyperqueue.cluster import WorkerConfig
from hyperqueue.ffi.protocol import ResourceRequest


def submit(client: Client, arguments: argparse.Namespace):
    """Every part a task of one core, and the merge once all are done."""
    job = Job(max_fails=None)
    # Workers run elsewhere.
    plan, data = str(arguments.plan.resolve()), str(arguments.data.resolve())
    one_core = ResourceRequest(cpus=1)
    folders = [f"{data}-parts/{part}" for part in range(1, arguments.parts + 1)]
    parts = [
        job.program(
            [arguments.haptograph, "batch", plan, "-o", folder]
            + ["--shard", f"{part}/{arguments.parts}", "--threads", "1"],
            name=f"part-{part}",
            resources=one_core,
        )
        for part, folder in enumerate(folders, start=1)
    ]
    merge = [arguments.haptograph, "batch", "merge", *folders, "-o", data]
    job.program(merge, name="merge", deps=parts, resources=one_core)
    return client.submit(job)


def main():
    parser = argparse.ArgumentParser(description="Render a data set in parts under HyperQueue")
    parser.add_argument("plan", type=Path)
    parser.add_argument("data", type=Path)
    parser.add_argument("--parts", type=int, default=8)
    parser.add_argument("--workers", type=int, default=2, help="workers to start here, of one core each")
    parser.add_argument("--server", help="the folder of a server that runs already")
    parser.add_argument("--haptograph", default="haptograph", help="the command")
    arguments = parser.parse_args()
    with nullcontext() if arguments.server else LocalCluster() as cluster:
        if cluster is not None:
            for _ in range(arguments.workers):
                cluster.start_worker(WorkerConfig(cores=1))
        client = Client(arguments.server) if cluster is None else cluster.client()
        # Raises where a task failed: the same call goes on where the parts stopped.
        client.wait_for_jobs([submit(client, arguments)])


if __name__ == "__main__":
    main()
