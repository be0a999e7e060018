#!/bin/sh -e
# Build source archive and wheel and try both, with PYTHON and each of the other Pythons that starts here.
# The wheel must work without the training extra, so each gets an environment of its own; it is built
# from the source archive, which must install by itself.
PYTHON=${PYTHON:-python3.11}
rm -rf build/wheel
.venv/bin/python -m build --no-isolation --outdir build/wheel
cp constraints.txt build/wheel
cd build/wheel
for python in "$PYTHON" python3.11 python3.12 python3.13 python3.14; do
  name=$("$python" -c 'import ensurepip, sys, venv; print("venv-%d.%d" % sys.version_info[:2])' 2>error.txt) || {
    [ "$python" != "$PYTHON" ] || { cat error.txt >&2; exit 1; }
    continue
  }
  [ ! -e "$name" ] || continue
  "$python" -m venv "$name"
  bin=$name/bin
  pip="$bin/python -m pip --disable-pip-version-check install -q"
  $pip -c constraints.txt ./*.whl
  $bin/python -c 'import hopping_leg, sys; assert "torch" not in sys.modules'
  $bin/python -c 'import gymnasium; gymnasium.make("hopping_leg:HoppingLeg-v0")'
  $bin/hop robots list
  $bin/hop export urdf --out leg.urdf
  $bin/hop evaluate energy-shaping --commands 0.3 --seeds 1 --floor soft --out report
  $pip -c constraints.txt "$(echo ./*.whl)[view]"
  $bin/hop view --no-browser --port 0 --seconds 1
  $pip --force-reinstall --no-deps ./*.tar.gz
  $bin/hop robots check legv2
  $bin/hop doctor
done
../../.venv/bin/uvx --python $bin/python --constraints constraints.txt --from ./*.whl hop --version
../../.venv/bin/pipx run --no-cache --pip-args="-c $PWD/constraints.txt" --spec "$(echo "$PWD"/*.whl)" hop --version
echo "Tried with $(echo venv-*)."
