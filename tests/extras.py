"""What happens where packages of the extras are not installed."""

import subprocess
import sys

TRAINING = ("torch", "stable_baselines3", "onnx", "tensorboard")  # Packages of the extra `train`

_BLOCK = """
import sys
class Block:
    def find_spec(self, name, *_):
        if name.split(".")[0] in {0!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Block())
"""


def run_without(packages, code):
    """Run code in a fresh interpreter in which none of these packages can be imported."""
    words = [sys.executable, "-c", _BLOCK.format(packages) + code]
    return subprocess.run(words, capture_output=True, text=True, timeout=120)
