"""Data sets on disk, in both formats, and what other engines read of them."""

import json
import pickle
import sys

import numpy as np
import pytest
from conftest import needed

import haptograph as hg

SIGNALS = ["vibration_m_s2", "speed_m_s", "force_n"]
LABELS = ["job", "surface", "surface_name", "motion", "motion_name", "seed", "samples", "rate_hz", "gain", "update_hz"] + [
    "mean_speed_m_s", "mean_force_n", "outside"
]


@pytest.fixture(scope="module", params=["Float32", "Float64"])
def folders(request, graphs, tmp_path_factory):
    """The same data set in both formats: two surfaces, two motions of different lengths, seeds beyond 2^63."""
    work = tmp_path_factory.mktemp("data-sets")
    for format in ("Npz", "Parquet"):
        (work / "plan.ron").write_text(
            f"""Batch(
    surfaces: ["{graphs}/surfaces/t1-plastic.ron", "{graphs}/surfaces/t2-canvas.ron"],
    motions: {{
        "explore": RandomWalk(seconds: 0.2, speed_mm_s: (5, 170), force_n: (0.1, 2.8)),
        "steady": Constant(seconds: 0.05, speed_mm_s: 80, force_n: 1),
    }},
    jobs: Product(seeds: (18446744073709551613, 18446744073709551615)),
    samples: {request.param}, jobs_per_chunk: 5, format: {format},
)"""
        )
        assert hg.batch(work / "plan.ron", work / format).complete
    return work / "Npz", work / "Parquet"


@pytest.fixture
def arrays(folders):
    return hg.open(folders[0])


def test_both_formats_have_the_same_jobs(folders, arrays):
    needed("pyarrow")
    table = hg.open(folders[1])
    assert len(table) == len(arrays) == 12 and table.complete and len(table.chunks) == 3
    for one, other in zip(arrays, table, strict=True):
        assert list(one) == list(other) == [*LABELS, *SIGNALS]
        assert all(np.array_equal(one[name], other[name]) and type(one[name]) is type(other[name]) for name in one)
        assert all(one[name].dtype == other[name].dtype and one[name].flags.writeable for name in SIGNALS)
    for number in range(3):
        one, other = arrays.chunk(number), table.chunk(number)
        assert list(one) == list(other)
        assert all(np.array_equal(one[name], other[name]) for name in one)
        assert all(one[name].dtype == other[name].dtype for name in one if not name.endswith("_name"))
    assert list(arrays.labels) == list(table.labels) == LABELS
    assert all(np.array_equal(arrays.labels[name], table.labels[name]) for name in LABELS)


def test_items_are_those_of_the_chunks(folders, arrays):
    manifest = json.loads((folders[0] / "manifest.json").read_text())
    position = 0
    for chunk, path in zip(manifest["chunks"], arrays.chunks, strict=True):
        with np.load(path) as stored:
            for row, samples in enumerate(stored["samples"]):
                job = arrays[position]
                assert all(np.array_equal(job[name], stored[name][row, :samples]) for name in SIGNALS)
                assert job["surface_name"] == manifest["surfaces"][job["surface"]]
                position += 1
        assert chunk["jobs"][1] == position
    assert arrays[-1]["seed"] == 2**64 - 1 and [job["job"] for job in arrays[2:9:3]] == [2, 5, 8]
    for beyond in (12, -13):
        with pytest.raises(IndexError):
            arrays[beyond]
    again = pickle.loads(pickle.dumps(arrays))
    steady = np.char.equal(arrays.labels["motion_name"].astype(str), "steady")
    assert np.allclose(arrays.labels["mean_speed_m_s"][steady], 0.08) and np.allclose(arrays.labels["mean_force_n"][steady], 1)
    assert again == arrays and np.array_equal(again[7]["force_n"], arrays[7]["force_n"])


def test_a_part_has_its_own_jobs(folders, tmp_path):
    hg.batch(folders[0].parent / "plan.ron", tmp_path / "part", shard=(2, 3))
    needed("pyarrow")
    part = hg.open(tmp_path / "part")
    assert len(part) == 5 and not part.complete
    assert part.labels["job"].tolist() == [5, 6, 7, 8, 9]


def by_pyarrow(folder):
    parquet = needed("pyarrow.parquet")
    return [row for path in sorted(folder.glob("*.parquet")) for row in parquet.read_table(path).to_pylist()]


def by_polars(folder):
    return needed("polars").scan_parquet(folder / "*.parquet").sort("job").collect().to_dicts()


def by_duckdb(folder):
    found = needed("duckdb").sql(f"SELECT * FROM '{folder}/*.parquet' ORDER BY job")
    return [dict(zip(found.columns, row, strict=True)) for row in found.fetchall()]


@pytest.mark.parametrize("read", [by_pyarrow, by_polars, by_duckdb])
def test_other_engines_read_the_same_bits(read, folders, arrays):
    rows = read(folders[1])
    assert len(rows) == len(arrays)
    for row, job in zip(rows, arrays, strict=True):
        assert list(row) == list(job)
        assert all(np.array_equal(np.array(row[name], job[name].dtype), job[name]) for name in SIGNALS)
        assert all(row[name] == job[name] for name in LABELS)


def test_the_footer_says_what_the_columns_are(folders, arrays):
    schema = needed("pyarrow.parquet").read_schema(sorted(folders[1].glob("*.parquet"))[0])
    units = json.loads(schema.metadata[b"units"])
    assert units["vibration_m_s2"] == "m/s2" and units["rate_hz"] == "Hz" and schema.metadata[b"rendered"] == b"true"
    about = json.loads(schema.metadata[b"haptograph"])
    assert [about["processor"]] == hg.open(folders[1]).manifest["processors"] == arrays.manifest["processors"]


def test_what_cannot_be_read_is_one_error(folders, arrays, tmp_path, monkeypatch):
    for folder in folders:
        data = tmp_path / folder.name
        data.mkdir()
        (data / "manifest.json").write_bytes((folder / "manifest.json").read_bytes())
        for path in folder.glob("chunk-*"):
            (data / path.name).write_bytes(path.read_bytes()[:3000])
        damaged = hg.open(data)
        (data / damaged.chunks[-1].name).unlink()
        if damaged.manifest["format"] == "Parquet":
            needed("pyarrow")
        for call in (lambda d=damaged: d[0], lambda d=damaged: d[11], lambda d=damaged: d.chunk(1), lambda d=damaged: d.labels):
            with pytest.raises(hg.Error, match="chunk-00000"):
                call()
    for wrong in ("0", None, 1.5, True):
        with pytest.raises(hg.Error):
            arrays[wrong]
    with pytest.raises(hg.Error):
        arrays.chunk(3)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(hg.Error, match="pip install pyarrow"):
        hg.open(folders[1])[0]
