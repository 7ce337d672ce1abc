"""A sweep on two worker processes, of which one is killed: nothing is lost."""

import os
import signal
import time
from typing import Any

import numpy as np
import pytest
from leaves import fan

import leafdyn

distributed = pytest.importorskip("distributed")

# Those of dask's own threads and sockets when its processes die.
pytestmark = pytest.mark.filterwarnings("ignore")

COUNT = int(os.environ.get("LEAFDYN_DASK_LEAVES", "400"))


def solved(scenario: leafdyn.Scenario) -> leafdyn.Equilibrium:
    return leafdyn.relax(scenario)


def test_leaves_of_a_worker_that_is_killed_are_not_lost() -> None:
    """LEAFDYN_DASK_LEAVES=2000 for the whole test."""
    scenarios = [leafdyn.Scenario(fan(5, gravity=weight)) for weight in np.linspace(0.0, 3.0, COUNT)]
    wanted = leafdyn.relax_many(scenarios)
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
    )
    with cluster, distributed.Client(cluster) as client:
        pids: dict[str, Any] = client.run(os.getpid)
        assert len(pids) == 2
        futures = client.map(solved, scenarios, retries=5)
        while sum(future.done() for future in futures) < COUNT // 10:
            time.sleep(0.01)
        os.kill(next(iter(pids.values())), signal.SIGKILL)
        found = client.gather(futures)
    assert len(found) == COUNT
    for one, other in zip(found, wanted):
        assert np.array_equal(one.positions, other.positions)
        assert one.scenario == other.scenario
