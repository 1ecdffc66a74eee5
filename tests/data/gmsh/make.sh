#!/usr/bin/env bash
# Makes the meshes of this folder with Gmsh itself (Debian's package gmsh): every family of elements in
# every form of the format. The files are kept, so that the tests need no Gmsh.
set -euo pipefail
cd "$(dirname "$0")"
rm -f ./*.msh

mesh() { # geometry, output, further options
  local geometry=$1 output=$2
  shift 2
  gmsh "$geometry.geo" -2 -v 2 "$@" -o "$output.msh" >/dev/null
}
for geometry in fillet sheet; do
  for family in quad8=8 tri6=6 mixed=0; do
    for version in msh22 msh41; do
      name=$geometry-${family%=*}-$version
      mesh $geometry "$name-ascii" -setnumber family "${family#*=}" -format $version
      mesh $geometry "$name-binary" -setnumber family "${family#*=}" -format $version -bin
    done
  done
done
# first order, and nine nodes: raised, and relieved of the centre node
mesh fillet fillet-mixed1-msh41-ascii -setnumber family 0 -setnumber order 1 -format msh41
mesh fillet fillet-quad9-msh22-ascii -setnumber family 8 -setnumber complete 1 -format msh22
# half a cylinder's contact with a block, unstructured, fine at the contact
mesh hertz hertz-tri6-msh41-binary -format msh41 -bin
# blocks for random obstacles, whole and halves
for family in quad8=8 tri6=6 mixed=0; do
  name=${family%=*} number=${family#*=}
  mesh block "block-half-$name" -setnumber family $number -setnumber width 6 -setnumber height 4 -setnumber step 0.25 -format msh41
  mesh block "block-whole-$name" -setnumber family $number -setnumber whole 1 -setnumber width 5 -setnumber height 5 -setnumber step 0.35 -format msh41
done
