#!/usr/bin/env bash
# The package for Python: built as one wheel, installed as users do it, and tested.
# With `build` or `run` the one or the other alone.
set -euo pipefail
cd "$(dirname "$0")/.."

part=${1-all}
if test "$part" != run; then
    python3 -m venv --clear target/venv
fi
PATH="$PWD/target/venv/bin:$PATH"
if test "$part" != run; then
    # With the live page, where it was built.
    if test -f web/dist/live.html; then
        export MATURIN_PEP517_ARGS="--features live"
        live=(--features live)
    fi
    pip install --quiet ./python
    pip install --quiet maturin pytest mypy matplotlib tqdm pandas xarray scipy anywidget pint "dask[distributed]" nbmake ipykernel trimesh embreex openpyxl
    # The wheel is one for all versions of Python.
    rm -rf target/wheels
    maturin build --release --locked ${live[@]+"${live[@]}"} --quiet --manifest-path python/Cargo.toml --out target/wheels
    test "$(ls target/wheels/*cp310-abi3*.whl | wc -l)" = 1
fi
if test "$part" = build; then
    exit
fi

cd python
# Comparisons of times are for a quiet machine: pytest tests/test_cost.py
pytest --pyargs tests leafdyn --deselect tests/test_cost.py::test_a_call_costs_little_over_the_library \
    --deselect tests/test_cost.py::test_a_replaced_entry_costs_little \
    --deselect tests/test_cost.py::test_many_share_the_processors \
    --deselect tests/test_cost.py::test_a_sweep_is_faster_than_by_processes
pytest --nbmake examples
mypy lib/leafdyn examples
stubtest leafdyn --mypy-config-file pyproject.toml --ignore-missing-stub
