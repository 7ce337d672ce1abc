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

from ._branches import Boundary, Branch, Curve, Piece, Trace
from ._errors import Interrupted, LeafWarning, MissingScenarioError, ScenarioError
from ._explore import Exploration, explore
from ._fit import Candidate, Fit, LikelihoodProfile, Parameter
from ._fitting import fit
from ._follow import boundary, trace
from ._format import Key, example, keys, new, schema
from ._leaf import Equilibrium
from ._leafdyn import __version__, set_threads, threads
from ._load import load
from ._motion import Frame, Motion
from ._posture import Bound, Posture, unbend, unbend_many
from ._predict import Prediction
from ._refused import RefusedLeaf
from ._relax import modes, relax, relax_many, sensitivities
from ._result import Result, Table
from ._scenario import Scenario, Source
from ._sensitivity import Sensitivities, Sensitivity
from ._simulate import frames, simulate
from ._study import Chart, Check, Equilibria, Map
from ._surface import Angles, Mesh
from ._sweep import sweep
from ._typed import ScenarioDict
from ._verbs import chart, check, equilibria, stability_map
from ._view import Page

# An attribute only: `from leafdyn import *` replaces no builtin.
map = stability_map

# The name under which scripts may know it.
all_shapes = equilibria

__all__ = [
    "Angles",
    "Bound",
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
    "Interrupted",
    "Key",
    "LeafWarning",
    "LikelihoodProfile",
    "Map",
    "Mesh",
    "MissingScenarioError",
    "Motion",
    "Page",
    "Parameter",
    "Piece",
    "Posture",
    "Prediction",
    "RefusedLeaf",
    "Result",
    "Scenario",
    "ScenarioDict",
    "ScenarioError",
    "Sensitivities",
    "Sensitivity",
    "Source",
    "Table",
    "Trace",
    "__version__",
    "boundary",
    "chart",
    "check",
    "equilibria",
    "example",
    "explore",
    "fit",
    "frames",
    "keys",
    "load",
    "modes",
    "new",
    "relax",
    "relax_many",
    "schema",
    "sensitivities",
    "set_threads",
    "simulate",
    "stability_map",
    "sweep",
    "threads",
    "trace",
    "unbend",
    "unbend_many",
]
