"""A sweep over many processes with dask: leaves and scenarios travel as they are, and a worker that dies is replaced.

    pip install ./python "dask[distributed]"
    python python/examples/sweep_dask.py

Point `Client` at a scheduler to use other machines.
"""

from __future__ import annotations

import numpy as np
from dask.distributed import Client, LocalCluster
from numpy.typing import NDArray

import leafdyn

FAN = "scenarios/paper/fig04.toml"


def tip(scenario: leafdyn.Scenario) -> NDArray[np.float64]:
    """What is wanted of each leaf. Whole results travel as well."""
    leaf = leafdyn.relax(scenario)
    assert leaf.tip is not None
    return leaf.tip


def main(count: int = 2000) -> None:
    base = leafdyn.Scenario(FAN, set={"leaf.rods": 5})
    weights = np.linspace(0.0, 4.0, count)
    scenarios = [leafdyn.Scenario(base, {"load.gravity": [0.0, 0.0, -weight]}) for weight in weights]
    # A leaf of five veins is solved by one thread: one thread a process is enough.
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster, Client(cluster) as client:
        tips = np.array(client.gather(client.map(tip, scenarios, batch_size=100)))
    for weight, height in list(zip(weights, tips[:, 2]))[:: count // 8]:
        print(f"weight {weight:5.2f}: tip at {height:8.5f}")


if __name__ == "__main__":
    main()
