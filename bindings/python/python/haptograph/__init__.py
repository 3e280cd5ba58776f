"""The feel of real surfaces as NumPy arrays: learn it, render it, run it.

>>> import haptograph as hg
>>> recording = hg.read("take.csv")                          # doctest: +SKIP
>>> surface = hg.learn(recording)                            # doctest: +SKIP
>>> vibration = surface.render(force=1.0, speed=0.1, seconds=2)   # doctest: +SKIP

Everything is in SI units: m, m/s, N, m/s2, s. What fails raises :class:`Error`, whose text is what the command
would print. Long calls let other threads run, and ctrl-C ends them.
"""

from ._batch import Rendered, batch, merge
from ._data_set import DataSet, open
from ._errors import Diagnostic, Error, GraphError, LearningWarning, RangeWarning
from ._evaluation import Evaluation, Identification, evaluate, identify
from ._export import Export, export
from ._graph import Graph
from ._native import __version__
from ._node import Node, Port, Setting
from ._player import Player
from ._recording import Recording, read
from ._run import Outcome, Run, Signal
from ._samples import Samples
from ._surface import Comparison, Coverage, Model, Surface, compare, learn, render

__all__ = [
    "Comparison",
    "Coverage",
    "DataSet",
    "Diagnostic",
    "Error",
    "Evaluation",
    "Export",
    "Graph",
    "GraphError",
    "Identification",
    "LearningWarning",
    "Model",
    "Node",
    "Outcome",
    "Player",
    "Port",
    "RangeWarning",
    "Recording",
    "Rendered",
    "Run",
    "Samples",
    "Setting",
    "Signal",
    "Surface",
    "__version__",
    "batch",
    "compare",
    "evaluate",
    "export",
    "identify",
    "learn",
    "merge",
    "open",
    "read",
    "render",
]
