"""ONNX graphs on one thread, each of which must prove on loading that it answers."""

import os
import threading
import time
from typing import Any

import numpy as np

from hopping_leg.errors import PolicyError

# Otherwise the import alone leaves a file in the temporary folder.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
import onnxruntime

_MOST_SECONDS = 2.0
_RUNS = 5


def open_session(content: bytes, origin: str) -> Any:  # noqa: ANN401
    """Return a session on one thread; raise ``PolicyError`` where the content is no ONNX graph."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 4
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime raises many unrelated types
        raise PolicyError(
            f"{origin} is not a readable ONNX file: truncated, damaged or of another kind."
        ) from error


def measure_session(session: Any, shapes: dict[str, tuple[int, ...]], origin: str) -> float:  # noqa: ANN401
    """Return how long a graph takes for one leg, s, the fastest of some runs.

    Raises:
        PolicyError: It fails, gives something else than torques, or does not return.
    """
    feeds = {name: np.zeros((1, *shape), np.float32) for name, shape in shapes.items()}
    options, took = onnxruntime.RunOptions(), np.inf
    options.log_severity_level = 4
    ending = threading.Timer(_MOST_SECONDS, setattr, (options, "terminate", True))
    ending.daemon = True
    ending.start()
    try:
        for _ in range(_RUNS):
            began = time.perf_counter()
            torque, *_ = session.run(None, feeds, options)
            took = min(took, time.perf_counter() - began)
    except Exception as error:  # onnxruntime raises many unrelated types
        if options.terminate:
            raise PolicyError(
                f"{origin} does not answer within {_MOST_SECONDS:g} s; does its graph loop?"
            ) from error
        raise PolicyError(f"{origin} fails where it is run: it is damaged.") from error
    finally:
        ending.cancel()
    if np.shape(torque) != (1, 2) or np.asarray(torque).dtype != np.float32:
        raise PolicyError(f"{origin} gives {np.shape(torque)} for one leg, not two torques.")
    return float(took)
