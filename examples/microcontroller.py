"""A policy with weights in 8 bits and as one C file without dependencies, compared and timed.

python examples/microcontroller.py [POLICY.onnx]; needs emx-onnx-cgen and a C compiler. What
`hop evaluate small.onnx` tells of the small policy holds for the C file.
"""

import ctypes
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
from onnx import helper, numpy_helper

import hopping_leg

policies = Path(hopping_leg.__file__).parent / "policies"
policy = Path(sys.argv[1]) if len(sys.argv) > 1 else policies / "rl.onnx"
graph = (model := onnx.load(policy)).graph
for weights in [w for w in graph.initializer if len(w.dims) > 1 and np.prod(w.dims) > 500]:
    values, axis = numpy_helper.to_array(weights), len(weights.dims) - 2
    scale = np.abs(values).max(axis=-1, keepdims=True, initial=1e-9) / 127  # of each row
    parts = {"int8": np.round(values / scale).astype(np.int8), "scale": scale.ravel()}
    names = [f"{weights.name}.{part}" for part in parts]
    graph.initializer.remove(weights)
    graph.initializer.extend(map(numpy_helper.from_array, parts.values(), names))
    graph.node.insert(0, helper.make_node("DequantizeLinear", names, [weights.name], axis=axis))
small = Path("small.onnx")
onnx.save(model, small)

compiler = [sys.executable, "-m", "emx_onnx_cgen", "compile", "--input-dim", "n=1"]
inside = ["--large-weight-threshold", "0", "--large-temp-threshold", "0"]  # no file, no malloc
options = [*compiler, *inside, "--model-name", "policy"]
subprocess.run([*options, small, "policy.c"], check=True, stdout=subprocess.DEVNULL)
subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", "policy.so", "policy.c", "-lm"], check=True)
act = ctypes.CDLL(Path("policy.so").resolve()).policy

session = onnxruntime.InferenceSession(small)
shapes = {i.name: (1, *i.shape[1:]) for i in session.get_inputs()}
outputs = [np.zeros((1, *o.shape[1:]), np.float32) for o in session.get_outputs()]
rng, seconds, pairs = np.random.default_rng(0), 0.0, []
inputs = {name: np.zeros(shape, np.float32) for name, shape in shapes.items()}
for _ in range(1000):
    for name in sorted(inputs.keys() - {"memory"}):
        inputs[name] = rng.uniform(0, 0.5, shapes[name]).astype(np.float32)
    expected = session.run(None, inputs)
    began = time.perf_counter()
    act(*(a.ctypes.data_as(ctypes.c_void_p) for a in (*inputs.values(), *outputs)))
    seconds += time.perf_counter() - began
    pairs.append((outputs[0].copy(), expected[0]))
    if len(outputs) > 1:
        inputs["memory"] = outputs[1].copy()
ours, theirs = np.array(pairs).swapaxes(0, 1)
off = np.abs(ours - theirs).max() / np.abs(theirs).max()
size = len(small.read_bytes()) / 1e3
print(f"{small}: {size:.0f} kB, {seconds * 1e3:.0f} us a call, torques differ by {off:.1e}")
