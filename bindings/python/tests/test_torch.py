"""What the package renders under PyTorch's loaders; where PyTorch is."""

import multiprocessing

import numpy as np
import pytest
from conftest import needed

import haptograph as hg

torch = needed("torch")

from torch.utils.data import DataLoader, IterableDataset, get_worker_info  # noqa: E402


def item(surface: hg.Surface, number: int) -> tuple[np.ndarray, np.ndarray, int]:
    """A vibration, its labels and its number: the number says all."""
    chance = np.random.default_rng(number)
    force, speed = chance.uniform(0.2, 2.8), chance.uniform(0.02, 0.17)
    vibration = surface.render(force, speed, seconds=0.05, seed=number)
    return vibration.astype(np.float32), np.float32([force, speed]), number


class Touch(IterableDataset):
    """Vibrations with the force and the speed that made them."""

    def __init__(self, surface: hg.Surface, last: int):
        self.surface, self.last = surface, last

    def __iter__(self):
        worker = get_worker_info()
        step, offset = (worker.num_workers, worker.id) if worker else (1, 0)
        return (item(self.surface, number) for number in range(offset, self.last, step))


WAYS = [None, *(way for way in ("fork", "forkserver", "spawn") if way in multiprocessing.get_all_start_methods())]


@pytest.mark.parametrize("way", WAYS)
def test_a_loader_gives_every_item_once_with_its_bits_whoever_renders_it(way, canvas):
    # What was rendered before a fork must not hold up what is rendered behind it.
    hg.render(canvas, np.ones((40, 500)), 0.1)
    workers = {} if way is None else {"num_workers": 2, "multiprocessing_context": way}
    seen = {}
    for vibrations, labels, numbers in DataLoader(
        Touch(canvas, 21), batch_size=4, timeout=0 if way is None else 120, **workers
    ):
        assert vibrations.dtype == labels.dtype == torch.float32
        for vibration, label, number in zip(vibrations, labels, numbers.tolist(), strict=True):
            assert number not in seen
            seen[number] = vibration, label
    assert sorted(seen) == list(range(21))
    for number, (vibration, label) in seen.items():
        wanted, wanted_label, _ = item(canvas, number)
        assert np.array_equal(vibration.numpy(), wanted) and np.array_equal(label.numpy(), wanted_label)


def test_a_tensor_is_an_array(canvas):
    force = torch.full((400,), 1.0)
    assert np.array_equal(canvas.render(force, 0.1, seed=1), canvas.render(np.ones(400), 0.1, seed=1))
    with pytest.raises(hg.Error, match="finite"):
        canvas.render(force * float("nan"), 0.1)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("format", ["Npz", "Parquet"])
def test_a_loader_reads_a_data_set(format, way, graphs, tmp_path):
    if format == "Parquet":
        needed("pyarrow")
    (tmp_path / "plan.ron").write_text(
        f"""Batch(
    surfaces: ["{graphs}/surfaces/t2-canvas.ron"],
    motions: {{ "steady": Constant(seconds: 0.05, speed_mm_s: 80, force_n: 1) }},
    jobs: Product(seeds: (1, 7)), jobs_per_chunk: 3, format: {format},
)"""
    )
    hg.batch(tmp_path / "plan.ron", tmp_path / "data")
    data = hg.open(tmp_path / "data")
    # What was read before a fork must not hold up what is read behind it.
    wanted = [job["vibration_m_s2"] for job in data]
    workers = {} if way is None else {"num_workers": 2, "multiprocessing_context": way, "timeout": 120}
    seen = 0
    for batch in DataLoader(data, batch_size=2, shuffle=True, **workers):
        for job, vibration in zip(batch["job"].tolist(), batch["vibration_m_s2"], strict=True):
            assert np.array_equal(vibration.numpy(), wanted[job])
            seen += 1
    assert seen == 7
