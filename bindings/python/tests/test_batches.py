"""Data sets from plans."""

import json

import numpy as np
import pytest

import haptograph as hg


@pytest.fixture
def plan(graphs, tmp_path):
    path = tmp_path / "plan.ron"
    path.write_text(
        f"""Batch(
    surfaces: ["{graphs}/surfaces/t2-*.ron"],
    motions: {{ "explore": RandomWalk(seconds: 0.2, speed_mm_s: (5, 170), force_n: (0.1, 2.8)) }},
    jobs: Product(seeds: (1, 5)),
    samples: Float64,
    jobs_per_chunk: 3,
)"""
    )
    return path


def test_parts_are_those_of_one_call_and_rows_those_of_render(plan, canvas, tmp_path):
    whole = hg.batch(plan, tmp_path / "whole")
    assert (whole.chunks, whole.rendered, whole.complete) == (2, 2, True)
    assert hg.batch(plan, tmp_path / "whole").kept == 2
    parts = [tmp_path / "one", tmp_path / "two"]
    for number, part in enumerate(parts, start=1):
        assert not hg.batch(plan, part, shard=(number, 2), threads=1).complete
    assert hg.merge(parts, tmp_path / "all") == (2, 5)
    manifest = json.loads((tmp_path / "all/manifest.json").read_text())
    assert manifest == json.loads((tmp_path / "whole/manifest.json").read_text())
    with np.load(tmp_path / "all" / manifest["chunks"][1]["file"]) as arrays:
        assert arrays["seed"].tolist() == [4, 5] and arrays["rate_hz"].tolist() == [canvas.rate] * 2
        again = hg.render(canvas, arrays["force_n"], arrays["speed_m_s"], seeds=arrays["seed"])
        assert np.array_equal(again, arrays["vibration_m_s2"])


def test_hostile_calls_are_errors(plan, tmp_path):
    data = tmp_path / "data"
    for call in (
        lambda: hg.batch(tmp_path / "none.ron", data),
        lambda: hg.batch(1, data),
        lambda: hg.batch(plan, data, shard=(3, 2)),
        lambda: hg.batch(plan, data, shard=(0, 2)),
        lambda: hg.batch(plan, data, shard=1),
        lambda: hg.batch(plan, data, threads=0),
        lambda: hg.batch(plan, plan),
        lambda: hg.merge([], data),
        lambda: hg.merge(data, data),
        lambda: hg.merge([data], tmp_path / "all"),
        lambda: hg.open(data),
        lambda: hg.open(plan),
        lambda: hg.open(3),
    ):
        with pytest.raises(hg.Error) as raised:
            call()
        assert len(str(raised.value)) > 10


def test_what_progress_raises_ends_the_call_where_another_goes_on(plan, tmp_path):
    def refuse(part):
        raise RuntimeError("enough")

    plan.write_text(plan.read_text().replace("0.2", "60").replace("jobs_per_chunk: 3", "jobs_per_chunk: 1"))
    with pytest.raises(RuntimeError, match="enough"):
        hg.batch(plan, tmp_path / "data", progress=refuse, threads=1)
    rest = hg.batch(plan, tmp_path / "data")
    assert rest.complete and rest.kept + rest.rendered == 5
    told = []
    assert hg.merge([tmp_path / "data"], tmp_path / "all", progress=told.append) == (5, 5)
    assert told == sorted(told)
