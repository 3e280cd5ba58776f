"""Trains on a data set in Parquet, on two workers of Ray Data or Dask: `pip install './bindings/python[parquet]' 'ray[data]' 'dask[dataframe]'`.

    haptograph batch train.ron -o data
    python train.py data --by ray

How loud is a surface under a hand? The logarithm of the power in windows of 0.1 s is fitted to the surface and the logarithms of speed and
force, by least squares. The workers sum the normal equations of their blocks of jobs; the sum is solved here, and compared with the solution
of one process.
"""

import argparse
import os
from functools import partial
from pathlib import Path

import haptograph as hg
import numpy as np

WINDOW_S = 0.1


def sums(jobs, surfaces: int) -> np.ndarray:
    """The normal equations of some jobs: their matrix, and their right side as its last column."""
    total = np.zeros((surfaces + 2, surfaces + 3))
    for job in jobs:
        samples = int(job["rate_hz"] * WINDOW_S)
        count = int(job["samples"]) // samples
        vibration, speed, force = (
            np.asarray(job[name], float)[: count * samples].reshape(count, samples)
            for name in ("vibration_m_s2", "speed_m_s", "force_n")
        )
        surface = np.zeros((count, surfaces))
        surface[:, job["surface"]] = 1
        inputs = np.column_stack([surface, np.log(speed.mean(axis=1)), np.log(force.mean(axis=1))])
        power = np.log(np.square(vibration).mean(axis=1) + 1e-12)
        total += inputs.T @ np.column_stack([inputs, power])
    return total


def of_table(table, surfaces: int) -> dict[str, np.ndarray]:
    """The normal equations of a block, which is a table of pandas, and the process that summed them."""
    return {"sums": sums(table.to_dict("records"), surfaces)[np.newaxis], "worker": np.array([os.getpid()])}


def by_ray(folder: Path, surfaces: int) -> list[dict]:
    import ray

    ray.init(num_cpus=2, include_dashboard=False)
    # A small data set is read as one block.
    blocks = ray.data.read_parquet(str(folder)).repartition(8)
    return blocks.map_batches(partial(of_table, surfaces=surfaces), batch_format="pandas").take_all()


def by_dask(folder: Path, surfaces: int) -> list[dict]:
    import dask
    import dask.dataframe

    blocks = dask.dataframe.read_parquet(f"{folder}/*.parquet").to_delayed()
    parts = [dask.delayed(of_table)(block, surfaces) for block in blocks]
    done = dask.compute(*parts, scheduler="processes", num_workers=2, chunksize=1)
    return [{name: part[name][0] for name in part} for part in done]


def solve(total: np.ndarray) -> np.ndarray:
    return np.linalg.solve(total[:, :-1], total[:, -1])


def main():
    parser = argparse.ArgumentParser(description="Train on a data set in Parquet")
    parser.add_argument("data", type=Path)
    parser.add_argument("--by", choices=["ray", "dask"], required=True)
    arguments = parser.parse_args()
    folder = arguments.data.resolve()
    data = hg.open(folder)
    surfaces = len(data.surfaces)
    blocks = {"ray": by_ray, "dask": by_dask}[arguments.by](folder, surfaces)
    fitted = solve(sum(np.array(block["sums"]) for block in blocks))
    for name, level in zip(data.surfaces, fitted, strict=False):
        print(f"{name}: {np.exp(level / 2):.3g} m/s2 at 1 m/s and 1 N")
    workers = len({int(block["worker"]) for block in blocks})
    print(f"power ~ speed^{fitted[-2]:.2f} force^{fitted[-1]:.2f}, from {len(data)} jobs by {workers} workers of {arguments.by}")
    alone = solve(sums(data, surfaces))
    assert np.allclose(fitted, alone, rtol=1e-9), (fitted, alone)


if __name__ == "__main__":
    main()
