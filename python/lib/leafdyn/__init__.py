"""How a leaf of coupled elastic veins comes to rest, with an error bar and a statement of stability.

>>> import leafdyn
>>> leaf = leafdyn.relax("scenarios/paper/fig04.toml", set={"leaf.rods": 5})
>>> leaf.stable, leaf.negative_eigenvalues
(True, 0)
>>> leaf.positions.shape == (5, len(leaf.stations), 3)
True

A scenario is a path, a text in TOML, or a dict of the same form. All quantities are in the units that it is written
in. Every verb of the program ``leafdyn`` is a function here; it returns what the program writes into files.
"""

from ._errors import LeafWarning, ScenarioError
from ._explore import Exploration, explore
from ._fit import Candidate, Fit, Parameter, fit
from ._leaf import Equilibrium
from ._leafdyn import __version__, set_threads, threads
from ._motion import Frame, Motion
from ._relax import modes, relax, relax_many, sensitivities
from ._result import Result, Table
from ._scenario import Scenario, Source
from ._sensitivity import Sensitivity
from ._study import Boundary, Branch, Chart, Check, Curve, Equilibria, Map, Trace
from ._verbs import chart, check, equilibria, frames, map, simulate, trace
from ._view import Page

# The name under which scripts may know it.
all_shapes = equilibria

__all__ = [
    "Boundary",
    "Branch",
    "Candidate",
    "Chart",
    "Check",
    "Curve",
    "Equilibria",
    "Equilibrium",
    "Exploration",
    "Fit",
    "Frame",
    "LeafWarning",
    "Map",
    "Motion",
    "Page",
    "Parameter",
    "Result",
    "Scenario",
    "ScenarioError",
    "Sensitivity",
    "Source",
    "Table",
    "Trace",
    "__version__",
    "chart",
    "check",
    "equilibria",
    "explore",
    "fit",
    "frames",
    "map",
    "modes",
    "relax",
    "relax_many",
    "sensitivities",
    "set_threads",
    "simulate",
    "threads",
    "trace",
]
