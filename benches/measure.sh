#!/usr/bin/env bash
# Measures the tables of docs/speed.md, the error estimates of
# docs/how-to-read.md and the intervals of docs/fit.md, and draws the charts. Hours on two cores, and worth
# little on a busy machine. Needs Python 3.11 and what pip installs below.
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_INSTALL_ROOT="$PWD/target/docs"
cargo install --path program
export PATH="$CARGO_INSTALL_ROOT/bin:$PATH"
python -m venv target/peers
source target/peers/bin/activate
pip install scipy
pip install pyelastica exudyn

cargo test --release --test statics error_estimate:: -- --nocapture
LEAFDYN_LEAVES=1000 cargo test --release --test fits coverage:: -- --nocapture
LEAFDYN_LEAVES=143 cargo test --release --test fits undetermined_family::
cargo bench --bench relax
cargo bench --bench real_leaves
cargo bench --bench growth
cargo bench --bench linear_solvers
cargo bench --bench shooting
cargo bench --bench explicit
cargo bench --bench sensitivity

# The paper's own route.
leafdyn relax scenarios/paper/fig04.toml --set leaf.rods=5 --tolerance 1e-12 --out out/fig04-5
OMP_NUM_THREADS=1 python benches/peers/solve_bvp.py scenarios/paper/fig04.toml --set leaf.rods=5 --tol 1e-8 --compare out/fig04-5
for figure in 05 06 08 09 10 13; do
  leaf="scenarios/paper/fig$figure.toml"
  leafdyn relax "$leaf" --set leaf.rods=5 --tolerance 1e-10 --out "out/fig$figure-5"
  # A run that does not converge is a result.
  OMP_NUM_THREADS=1 python benches/peers/solve_bvp.py "$leaf" --set leaf.rods=5 --tol 1e-3 --compare "out/fig$figure-5" || true
done

# PyElastica and exudyn.
cargo build --release
# Every verb on every scenario.
python benches/verbs.py target/release/leafdyn
# Needs valgrind, perf and objdump besides.
python benches/roofline.py target/release/leafdyn scenarios/paper/fig04.toml --set leaf.rods=35
export OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1
leafdyn relax scenarios/paper/fig04.toml --set leaf.rods=5 --tolerance 1e-10 --out out/fig04-5
python benches/peers/pyelastica.py scenarios/paper/fig04.toml --leafdyn target/release/leafdyn
python benches/peers/pyelastica.py scenarios/paper/fig04.toml --set leaf.rods=5 --relax --segments 20 --compare out/fig04-5
python benches/peers/exudyn.py scenarios/paper/fig04.toml --set leaf.rods=5 --segments 20 --compare out/fig04-5
for figure in 05 06 08 09 10 13; do
  python benches/peers/exudyn.py "scenarios/paper/fig$figure.toml" --set leaf.rods=5 --segments 20 --compare "out/fig$figure-5" || true
done

python benches/peers/least_squares.py scenarios/measured/pull.toml --data scenarios/measured/turned.csv --set stiffness.torsion=0.8 --set stiffness.shear_2=40 --set stiffness.shear_3=50 --free stiffness.bending_2=1.0 --free stiffness.bending_3=1.0 --free stiffness.axial=100.0

# The charts: three runs of every other program, then all methods.
rm -f out/peers.csv
python benches/peers/solve_bvp.py scenarios/paper/fig04.toml --set leaf.rods=5 --tol 1e-6 --compare out/fig04-5 --csv out/peers.csv
peer() { python "benches/peers/$1.py" scenarios/paper/fig04.toml --set "leaf.rods=$2" "${@:3}" --compare "out/fig04-$2" --csv out/peers.csv; }
for rods in 21 35; do
  leafdyn relax scenarios/paper/fig04.toml --set "leaf.rods=$rods" --tolerance 1e-10 --out "out/fig04-$rods"
done
for run in 1 2 3; do
  for tolerance in 1e-3 1e-4 1e-5 1e-6 1e-8; do peer solve_bvp 5 --tol "$tolerance"; done
  for segments in 10 20 40; do
    peer exudyn 5 --segments "$segments"
    peer pyelastica 5 --relax --segments "$segments"
  done
  peer solve_bvp 21 --tol 1e-3
  peer solve_bvp 35 --tol 1e-3
  peer exudyn 35 --segments 50
done
leafdyn chart scenarios/paper/fig04.toml --set leaf.rods=5 --seconds 20 --peers out/peers.csv
cp out/fig04/chart.svg docs/chart_fig04_5.svg
leafdyn chart scenarios/paper/fig04.toml --set leaf.rods=35 --seconds 20 --peers out/peers.csv
cp out/fig04/chart.svg docs/chart_fig04_35.svg
python benches/peers/turns.py scenarios/paper/fig04.toml --rods 5,21,35
python benches/peers/turns.py benches/peers/lattice.toml --rods 5 --tolerances 1e-1,1e-2,1e-3,1e-4,1e-5 \
  --peer 'exudyn --segments 20 --load-steps 5' --peer 'exudyn --segments 40 --load-steps 5' --peer 'exudyn --segments 80 --load-steps 5'

# Leaves that move, in PyElastica and exudyn.
python benches/peers/frequency.py benches/peers/cantilever.toml --leafdyn target/release/leafdyn
leafdyn simulate benches/peers/cantilever.toml --segments 512 --method explicit --stations 128 --write csv,json
leafdyn simulate benches/peers/heave.toml --segments 512 --method explicit --stations 128 --write csv,json
leafdyn simulate scenarios/motion/swing.toml --set dynamics.duration=2.0 --segments 256 --method explicit --stations 128 --write csv,json
rm -f out/moved.csv
python benches/peers/exudyn.py benches/peers/heave.toml --motion --segments 20 --compare out/heave --csv out/moved.csv
python benches/peers/pyelastica.py benches/peers/heave.toml --motion --segments 20 --base-springs --compare out/heave --csv out/moved.csv
move() { python "benches/peers/$1.py" "$2" --motion --segments "$3" "${@:5}" --compare "out/$4" --csv out/moved.csv; }
for run in 1 2 3; do
  for leaf in cantilever heave; do
    for segments in 10 20 40; do
      move exudyn "benches/peers/$leaf.toml" "$segments" "$leaf"
      move pyelastica "benches/peers/$leaf.toml" "$segments" "$leaf"
      move pyelastica "benches/peers/$leaf.toml" "$segments" "$leaf" --base-springs
    done
    move pyelastica "benches/peers/$leaf.toml" 80 "$leaf" --base-springs
  done
  for segments in 10 20 40; do
    move pyelastica scenarios/motion/swing.toml "$segments" swing --base-springs --set dynamics.duration=2.0
  done
done
leafdyn chart benches/peers/cantilever.toml --motion --seconds 5 --peers out/moved.csv
leafdyn chart benches/peers/heave.toml --motion --seconds 5 --peers out/moved.csv
cp out/heave/chart.svg docs/chart_heave.svg
leafdyn chart scenarios/motion/swing.toml --set dynamics.duration=2.0 --motion --seconds 5 --peers out/moved.csv

# A leaf as one measures it. That others do not come to rest is a result; those that take minutes run once.
leafdyn relax scenarios/measured/lily.toml --tolerance 1e-10 --out out/lily
lily() { python "benches/peers/$1.py" scenarios/measured/lily.toml "${@:2}" --compare out/lily --csv out/peers.csv || true; }
lily solve_bvp --tol 1e-3
lily pyelastica --relax --segments 10
lily pyelastica --relax --segments 20
for run in 1 2 3; do
  for steps in 1 10 100; do lily exudyn --segments 20 --load-steps "$steps"; done
  for segments in 20 40 80; do lily exudyn --segments "$segments" --load-steps 10 --close-tips; done
done
leafdyn chart scenarios/measured/lily.toml --seconds 20 --peers out/peers.csv
cp out/lily/chart.svg docs/chart_lily.svg
