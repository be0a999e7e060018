#!/bin/sh -e
# Build source archive and wheel and try both. The wheel must work without the training extra, so it
# gets an environment of its own; it is built from the source archive, which must install by itself.
rm -rf build/wheel
.venv/bin/python -m build --no-isolation --outdir build/wheel
"${PYTHON:-python3.11}" -m venv build/wheel/venv
cp constraints.txt build/wheel
cd build/wheel
pip="venv/bin/python -m pip --disable-pip-version-check install -q"
$pip -c constraints.txt ./*.whl
venv/bin/python -c 'import hopping_leg, sys; assert "torch" not in sys.modules'
venv/bin/python -c 'import gymnasium; gymnasium.make("hopping_leg:HoppingLeg-v0")'
../../.venv/bin/uvx --python venv/bin/python --constraints constraints.txt --from ./*.whl hop --version
../../.venv/bin/pipx run --no-cache --pip-args="-c $PWD/constraints.txt" --spec "$(echo "$PWD"/*.whl)" hop --version
venv/bin/hop robots list
venv/bin/hop export urdf --out leg.urdf
venv/bin/hop evaluate energy-shaping --commands 0.3 --seeds 1 --floor soft --out report
$pip -c constraints.txt "$(echo ./*.whl)[view]"
venv/bin/hop view --no-browser --port 0 --seconds 1
$pip --force-reinstall --no-deps ./*.tar.gz
venv/bin/hop robots check legv2
venv/bin/hop doctor
