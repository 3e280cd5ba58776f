"""A data set in parts under Ray: `pip install ray ./bindings/python`.

    python parts.py plan.ron data --parts 8

On a cluster, the folder has to be one that all machines share. A part whose worker dies is rendered again, and goes on where it stopped.
"""

import argparse
from pathlib import Path

import haptograph as hg
import ray


@ray.remote(num_cpus=1, max_retries=3)
def render(plan: str, folder: str, part: int, parts: int) -> str:
    """One part, on one core."""
    hg.batch(plan, folder, shard=(part, parts), threads=1)
    return folder


def main():
    parser = argparse.ArgumentParser(description="Render a data set in parts under Ray")
    parser.add_argument("plan", type=Path)
    parser.add_argument("data", type=Path)
    parser.add_argument("--parts", type=int, default=8)
    arguments = parser.parse_args()
    ray.init()
    numbers = range(1, arguments.parts + 1)
    # Workers run elsewhere.
    plan, folder = str(arguments.plan.resolve()), f"{arguments.data.resolve()}-parts"
    parts = [render.remote(plan, f"{folder}/{part}", part, arguments.parts) for part in numbers]
    chunks, jobs = hg.merge(ray.get(parts), arguments.data)
    print(f"{jobs} jobs in {chunks} chunks: {arguments.data}")


if __name__ == "__main__":
    main()
