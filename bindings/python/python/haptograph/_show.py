"""Rich display in notebooks."""

from __future__ import annotations

import base64
import html
import io
import wave

import numpy as np

_AUDIO_HZ = 48_000
_MOST_SECONDS = 30


def audio(values: np.ndarray, rate: float, title: str) -> str:
    """A player of a vibration, at most 30 s of it, as loud as it can be."""
    values = values[: int(rate * _MOST_SECONDS)]
    peak = float(np.abs(values).max()) if values.size else 0.0
    if peak == 0.0:
        return ""
    times = np.arange(int(len(values) / rate * _AUDIO_HZ)) / _AUDIO_HZ
    played = np.interp(times, np.arange(len(values)) / rate, values) / peak
    buffer = io.BytesIO()
    with wave.open(buffer, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(_AUDIO_HZ)
        file.writeframes((played * 32_000).astype("<i2").tobytes())
    data = base64.b64encode(buffer.getvalue()).decode()
    return f'<figure><figcaption>{html.escape(title)}</figcaption><audio controls src="data:audio/wav;base64,{data}"></audio></figure>'


def table(rows: list[tuple[str, str]], title: str) -> str:
    """Names and values."""
    cells = "".join(f"<tr><th>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>" for name, value in rows)
    return f"<table><caption>{html.escape(title)}</caption>{cells}</table>"
