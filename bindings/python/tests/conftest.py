"""Where things are, and a recording that the library itself synthesised."""

import importlib
import os
import signal
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import haptograph as hg

# A shell starts what runs in its background deaf to ctrl-C, and Python keeps it so.
signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).resolve().parents[3]


def needed(name: str) -> ModuleType:
    """A package that not every machine has: the test is skipped without it, and fails where nothing may be skipped."""
    return importlib.import_module(name) if os.environ.get("HAPTOGRAPH_NO_SKIPS") else pytest.importorskip(name)


@pytest.fixture(scope="session")
def graphs() -> Path:
    return ROOT / "graphs"


@pytest.fixture(scope="session")
def canvas(graphs) -> hg.Surface:
    return hg.Surface.load(graphs / "surfaces/t2-canvas.ron")


def stroke(samples: int, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Forces (N) and speeds (m/s) of a hand that tries both."""
    times = np.arange(samples) / rate
    force = 1.2 + 0.9 * np.sin(2 * np.pi * 0.43 * times)
    speed = 0.09 + 0.07 * np.sin(2 * np.pi * 0.71 * times + 1)
    return force, speed


@pytest.fixture(scope="session")
def drag(canvas) -> hg.Recording:
    rate = canvas.rate
    force, speed = stroke(int(12 * rate), rate)
    return hg.Recording(canvas.render(force, speed, seed=3), force, speed, rate, tangential=0.4 * force)


@pytest.fixture(scope="session")
def pad(graphs) -> hg.Graph:
    return hg.Graph.load(graphs / "texturepad.ron")
