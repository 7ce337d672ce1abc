#!/usr/bin/env bash
# Runs the long commands of README.md and docs, and draws the maps and pictures
# of these pages anew. About half an hour on two cores.
set -euo pipefail
cd "$(dirname "$0")/.."
top=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The program goes into target/, not among the user's own.
export CARGO_INSTALL_ROOT="$top/target/docs"
cargo install --path program
export PATH="$CARGO_INSTALL_ROOT/bin:$PATH"

ln -s "$top/scenarios" "$work/scenarios"
cd "$work"

leafdyn relax scenarios/paper/fig04.toml
cp out/fig04/figure.svg "$top/docs/fig04.svg"

leafdyn trace scenarios/paper/fig10.toml --set leaf.rods=5 --set 'load.gravity=[0,0,0]' \
  --vary stiffness.bending_2=1..0.8 --switch
cp out/fig10/trace.svg "$top/docs/trace_fig10.svg"

leafdyn relax scenarios/study/undulation.toml
cp out/undulation/figure.svg "$top/docs/undulation.svg"

leafdyn relax scenarios/study/undulation.toml --write surface --out out/surface
cp out/surface/surface.png "$top/docs/undulating-leaf.png"

leafdyn simulate scenarios/motion/snap.toml --write gif --out out/snap
cp out/snap/motion.gif "$top/docs/snap.gif"

leafdyn unbend scenarios/field/palm.toml --shape scenarios/field/palm.csv --format biomech --out out/palm-posture
cp out/palm-posture/unbend.svg "$top/docs/palm.svg"

# docs/command-line.md
leafdyn chart scenarios/paper/fig04.toml --set leaf.rods=5

# docs/methods.md
leafdyn simulate scenarios/paper/fig08.toml --set leaf.rods=5 --set dynamics.section_radius=0.2 --set dynamics.duration=100 --segments 64

# docs/where-methods-fail.md
leafdyn map scenarios/paper/fig04.toml --set leaf.rods=3 --set method.segments=16 --set dynamics.duration=30 --out out/explicit-motion \
  --vary 'stiffness.axial+stiffness.shear_2+stiffness.shear_3=1..1e6:13log' --vary 'method.step=1e-5..1e-1:13log' \
  --methods explicit-motion --cell-seconds 60
leafdyn map scenarios/paper/fig04.toml --set leaf.rods=3 --cell-seconds 10 --out out/soft-veins \
  --vary 'stiffness.bending_2=1..1e-5:11log' --vary 'load.gravity[2]=-1e-3..-10:9log'
leafdyn map scenarios/paper/fig04.toml --set leaf.rods=3 --set method.step=1e-3 --cell-seconds 10 --out out/stiffness \
  --vary 'stiffness.axial+stiffness.shear_2+stiffness.shear_3=1..1e10:21log'
leafdyn map scenarios/paper/fig10.toml --set leaf.rods=5 --cell-seconds 10 --out out/saddles \
  --vary 'stiffness.bending_2=0.01..1:13log' --vary 'load.gravity[2]=-2e-4..-2:9log'
for map in explicit-motion soft-veins stiffness saddles; do
  cp "out/$map/map.svg" "$top/docs/maps/$map.svg"
done

# docs/undulation.md
leafdyn relax scenarios/paper/fig08.toml --set leaf.rods=5 --set 'load.gravity=[0,0,0]' --segments 320 --keep-unstable
leafdyn trace scenarios/study/saddle.toml --tolerance 1e-3 --vary blade.thickness=0.0389..0.038 --set leaf.rods=17 \
  --set 'rest.stretch=[1.0088581,1.006782,1.0049827,1.0034602,1.0022145,1.0012457,1.0005536,1.0001384,1.0,1.0001384,1.0005536,1.0012457,1.0022145,1.0034602,1.0049827,1.006782,1.0088581]'
K='stiffness.bending_2[0]+stiffness.bending_2[1]+stiffness.bending_2[2]+stiffness.bending_2[3]+stiffness.bending_2[4]'
K="$K+stiffness.bending_2[6]+stiffness.bending_2[7]+stiffness.bending_2[8]+stiffness.bending_2[9]+stiffness.bending_2[10]"
leafdyn map scenarios/study/undulation.toml --tolerance 1e-4 --methods semi-implicit --show waves --out out/undulation-map \
  --vary "$K=1..1e-2:32log" --vary 'stiffness.torsion=0.1..10:32log'
leafdyn trace scenarios/study/undulation.toml --set 'load.gravity=[0,0,0]' --tolerance 1e-4 --out out/below \
  --vary "$K=1..0.4:50log" --vary 'stiffness.torsion=0.1..1.2:64log'
leafdyn trace scenarios/study/undulation.toml --set 'load.gravity=[0,0,0]' --tolerance 1e-4 --out out/above \
  --set 'stiffness.bending_2=[0.4,0.4,0.4,0.4,0.4,1000,0.4,0.4,0.4,0.4,0.4]' \
  --vary 'stiffness.torsion=10..0.9:50log' --vary "$K=1..0.01:64log"
leafdyn trace scenarios/study/undulation.toml --set 'load.gravity=[0,0,0]' --tolerance 1e-4 --map 16x16 --out out/above-map \
  --set 'stiffness.bending_2=[0.4,0.4,0.4,0.4,0.4,1000,0.4,0.4,0.4,0.4,0.4]' \
  --vary 'stiffness.torsion=10..0.9:50log' --vary "$K=1..0.01:64log"
leafdyn trace scenarios/study/undulation.toml --set 'load.gravity=[0,0,0]' --tolerance 1e-4 --map 16x16 --out out/below-map \
  --vary "$K=1..0.4:50log" --vary 'stiffness.torsion=0.1..1.2:12log'
leafdyn trace scenarios/study/undulation.toml --set 'load.gravity=[0,0,0]' --tolerance 1e-4 --map 8x8 --out out/growth \
  --vary "$K=1..0.1:50log" --vary 'rest.stretch[0]+rest.stretch[10]=1.35..1.15:40'
leafdyn trace scenarios/paper/fig10.toml --set 'load.gravity=[0,0,0]' --tolerance 1e-4 --out out/fig10-flat-21 \
  --vary stiffness.bending_2=1..0.8 --vary 'stiffness.torsion=0.008..0.5:24log'
leafdyn trace scenarios/paper/fig10.toml --set leaf.rods=5 --set 'load.gravity=[0,0,0]' --tolerance 1e-4 --out out/fig10-flat \
  --vary stiffness.bending_2=1..0.8 --vary 'stiffness.torsion=0.008..0.5:24log'
# It finds no curve, which is exit status 1.
set +e
leafdyn trace scenarios/paper/fig10.toml --set leaf.rods=5 --tolerance 1e-4 --map 8x8 --out out/fig10-arched \
  --vary 'stiffness.torsion=10..0.0001:32log' --vary 'load.gravity[2]=-0.0001..-3:16log'
set -e
leafdyn trace scenarios/study/undulation.toml --set 'load.gravity=[0,0,0]' --tolerance 1e-4 --switch --vary "$K=0.48..0.4:12log" --out out/waves
cp out/undulation-map/map.svg "$top/docs/maps/undulation.svg"
cp out/below-map/boundary.svg "$top/docs/maps/undulation_boundary.svg"
cp out/above-map/boundary.svg "$top/docs/maps/undulation_boundary_above.svg"
cp out/growth/boundary.svg "$top/docs/maps/undulation_growth.svg"
