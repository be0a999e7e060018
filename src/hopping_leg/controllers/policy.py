"""A trained policy: an ONNX graph from raw joint measurements to joint torques.

The file is self-contained: normalisation and torque scaling are inside the graph, its contract
(robot, inputs with units, rate, range of commands, known limits) is in its metadata, and as JSON
beside it for other runtimes. It runs through onnxruntime alone.
"""

import contextlib
import hashlib
import importlib
import json
import os
import threading
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hopping_leg.arrays import Array
from hopping_leg.controllers.observation_history import AnyLeg, make_observation_history
from hopping_leg.errors import PolicyError, UsageError
from hopping_leg.io import Tree, parse_json, plain, read_dataclass, write_atomically, write_json
from hopping_leg.robot.parameters import Robot
from hopping_leg.sim.channel import Measurement

# Otherwise the import alone leaves a file in the temporary folder.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
import onnxruntime

_MOST_SECONDS = 2.0
_RUNS = 5


def open_session(content: bytes, origin: str) -> Any:  # noqa: ANN401
    """Return a session on one thread; raise ``PolicyError`` where the content is no ONNX graph."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 4
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime raises many unrelated types
        raise PolicyError(
            f"{origin} is not a readable ONNX file: truncated, damaged or of another kind."
        ) from error


def measure_session(session: Any, shapes: dict[str, tuple[int, ...]], origin: str) -> float:  # noqa: ANN401
    """Return how long a graph takes for a leg, s; PolicyError where it gives no torques."""
    feeds = {name: np.zeros((1, *shape), np.float32) for name, shape in shapes.items()}
    options, took = onnxruntime.RunOptions(), []
    options.log_severity_level = 4
    ending = threading.Timer(_MOST_SECONDS, setattr, (options, "terminate", True))
    ending.daemon = True
    ending.start()
    try:
        for _ in range(_RUNS):
            began = time.perf_counter()
            torque = np.asarray(session.run(None, feeds, options)[0])
            took.append(time.perf_counter() - began)
    except Exception as error:  # onnxruntime raises many unrelated types
        why = f"does not answer within {_MOST_SECONDS:g} s; does its graph loop?"
        if not options.terminate:
            why = "fails where it is run: it is damaged."
        raise PolicyError(f"{origin} {why}") from error
    finally:
        ending.cancel()
    if torque.shape != (1, 2) or torque.dtype != np.float32:
        raise PolicyError(f"{origin} gives {torque.shape} for one leg, not two torques.")
    return min(took)


SCHEMA = 1
"""Version of the policy file's layout."""

METADATA_KEY = "hopping_leg"
"""Entry of the ONNX metadata that holds a ``Card`` as JSON."""

MEMORY, NEXT_MEMORY = "memory", "next_memory"
"""Input and output of a graph that remembers: what it gave at a tick is what it gets at the next,
and zeros at first."""

INPUTS = ("hip position", "knee position", "hip velocity", "knee velocity")
"""What a card's ``input_low`` and ``input_high`` bound."""

_SUM = "policy_sha256"  # Entry by which a contract is known
_OUTPUTS = {"torque": {"shape": ["n", 2], "unit": "N m"}}

_CONVERTER = "hopping_leg.rl.foreign"
"""What makes policies of other networks; the training's packages are needed for that alone."""

_ROUNDING = 1e-9
_MOST_RATE = 1e4  # Hz
_MARGIN = 0.25  # Share of its range of inputs by which they may lie beyond it


@dataclass(frozen=True)
class Card:
    """What a policy file says about itself."""

    recipe: str
    """Training recipe."""
    layout: str
    """Observation layout, one of ``controllers.observation_history.OBSERVATION_HISTORIES``."""
    command_low: float
    """Lowest command of the training, m."""
    command_high: float
    """Highest command of the training, m."""
    torque_scale: tuple[float, float]
    """Joint torque at full action, N m."""
    robot: str
    """Name of the robot it was trained on."""
    robot_digest: str
    """Hash of that robot's parameters."""
    rate: float
    """Control rate, Hz."""
    seed: int = 0
    """Training seed."""
    steps: int = 0
    """Control steps of experience."""
    versions: dict[str, str] = field(default_factory=dict)
    """Versions of the libraries that trained it."""
    input_low: tuple[float, ...] = ()
    """Smallest of what its joints did in the trials that selected it: positions of hip and knee,
    rad, then their velocities, rad/s; empty where nothing was stored."""
    input_high: tuple[float, ...] = ()
    """Largest of the same."""
    known_limits: tuple[str, ...] = ()
    """What is known to fail, a sentence each."""

    def __post_init__(self) -> None:
        bounds = {len(self.input_low), len(self.input_high)}
        commands = 0 < self.command_low <= self.command_high and min(self.torque_scale) > 0
        inputs = bounds in ({0}, {len(INPUTS)}) and self.input_low <= self.input_high
        if not (1 <= self.rate <= _MOST_RATE and commands and inputs):
            raise PolicyError(
                "A policy's card holds numbers that none has; export the policy again."
            )

    def contract(self) -> Tree:
        """Return the card with the layout's inputs, their units and limit, as JSON values."""
        history = make_observation_history(self.layout, 1 / self.rate)
        about = {"inputs": history.describe(), "limit_of_inputs": history.limit}
        contract: Tree = plain({"schema": SCHEMA, "outputs": _OUTPUTS, **asdict(self), **about})
        return contract

    def to_json(self) -> str:
        """Return the contract as stored in the file."""
        return json.dumps(self.contract(), sort_keys=True)

    @staticmethod
    def from_json(text: str, origin: str) -> "Card":
        """Read a stored card; PolicyError where it is of another schema, incomplete or damaged."""
        origin = f"The card of {origin}"
        values = parse_json(text, origin, PolicyError)
        if (schema := values.pop("schema", None)) != SCHEMA:
            raise PolicyError(
                f"{origin} is of schema {schema}; this version reads schema {SCHEMA}."
            )
        told = {name: values.pop(name, None) for name in ("inputs", "outputs", "limit_of_inputs")}
        card = read_dataclass(Card, values, origin, error=PolicyError)
        if told["inputs"] not in (None, card.contract()["inputs"]):
            raise PolicyError(
                f"{origin} tells other inputs than layout '{card.layout}' has in this version."
            )
        return card


class NoCardError(PolicyError):
    """An ONNX file has no card."""


class Policy:
    """Runs a policy file that came from ``origin``; implements ``Controller``.

    The digest are the first 16 hex digits of the file's SHA-256; ``seconds`` is how long it takes
    for one leg on this computer. PolicyError says that the content is no policy file that this
    version can run, or never returns.
    """

    def __init__(self, content: bytes, origin: str, name: str) -> None:
        self.name, self.origin, self.content = name, origin, content
        self.digest = hashlib.sha256(content).hexdigest()[:16]
        self._session = open_session(content, origin)
        try:
            text = self._session.get_modelmeta().custom_metadata_map.get(METADATA_KEY)
        except UnicodeDecodeError as error:
            raise PolicyError(f"{origin} has a damaged policy card: it is no text.") from error
        if text is None:
            raise NoCardError(
                f"{origin} is an ONNX file but not a policy; make one with `hop train`."
            )
        self.card = Card.from_json(text, origin)
        self._layout = make_observation_history(self.card.layout, 1 / self.card.rate)
        self.for_any_leg = isinstance(self._layout, AnyLeg)
        """Whether it is for any leg, once it is told which."""
        self.scale = 1.0
        """Size of the leg that it is on, over that of the paper's, if it is for any leg."""
        found = {i.name: tuple(i.shape[1:]) for i in self._session.get_inputs()}
        outputs = [tuple(o.shape[1:]) for o in self._session.get_outputs()]
        shape = found.pop(MEMORY, ())
        if shape and not isinstance(shape[0], int):
            raise PolicyError(f"{origin} has a memory of unknown size {shape}.")
        shapes = self._layout.shapes
        if found != shapes or outputs != ([(2,), shape] if shape else [(2,)]):
            raise PolicyError(
                f"{origin} takes {found} and gives {outputs}, but layout '{self._layout.name}'"
                f" takes {shapes} and gives one array of two torques."
            )
        self._memory_size = shape[0] if shape else 0
        memory = {MEMORY: shape} if shape else {}
        self.seconds = measure_session(self._session, shapes | memory, origin)
        self.reset(0)

    @staticmethod
    def load(path: Path) -> "Policy":
        """Read a policy, a stable-baselines3 .zip or an ONNX network trained on the environment.

        PolicyError says that it is missing, truncated, foreign, of another schema, or not what the
        contract beside it, ``NAME.json``, tells.
        """
        try:
            content, origin = path.read_bytes(), str(path)
        except OSError as error:
            raise PolicyError(f"Cannot read policy file {path}: {error.strerror}.") from error
        if path.suffix != ".zip":
            with contextlib.suppress(NoCardError):
                policy, beside = Policy(content, origin, path.stem), path.with_suffix(".json")
                told = parse_json(beside.read_bytes(), str(beside)) if beside.is_file() else {}
                own = policy.contract().items() if _SUM in told else ()
                if wrong := [name for name, value in own if told.get(name) != value]:
                    raise PolicyError(
                        f"{beside} is not the contract of {origin}: '{wrong[-1]}' differs; take"
                        " both files from where they were written, or remove the contract."
                    )
                return policy
        converter = importlib.import_module(_CONVERTER)
        return Policy(converter.convert(content, path), origin, path.stem)

    def save(self, path: Path) -> None:
        """Write the policy and, beside it, its contract as JSON."""
        write_atomically(path, self.content)
        write_json(path.with_suffix(".json"), self.contract())

    def contract(self) -> Tree:
        """Return the card's contract, and the file's SHA-256 and memory, as JSON values."""
        memory = {"memory": self._memory_size} if self._memory_size else {}
        return {_SUM: hashlib.sha256(self.content).hexdigest(), **memory, **self.card.contract()}

    @property
    def command_range(self) -> tuple[float, float]:
        """Lowest and highest command, m; one for any leg is asked for more on a longer one."""
        return self.scale * self.card.command_low, self.scale * self.card.command_high

    def set_robot(self, robot: Robot) -> None:
        """Say what leg it is on, as far as is known: that counts where it is for any leg."""
        self._layout.set_robots([robot])
        if self.for_any_leg:
            self.scale = robot.size

    def stranger(self, robot: Robot, name: str) -> str:
        """Return a sentence that names the policy if a robot is not that of its training, or ""."""
        card = self.card
        if self.for_any_leg or robot.has_digest(card.robot_digest):
            return ""
        if not card.robot:
            beside = Path(self.origin).with_suffix(".toml")
            return (
                f'Nothing says on which robot {name} was trained; write robot = "..." to {beside}.'
            )
        return (
            f"{name} was trained on robot '{card.robot}' ({card.robot_digest}), not on"
            f" '{robot.name}' ({robot.digest}); name its own with --robot."
        )

    def reset(self, count: int) -> None:
        """Forget everything; the next measurement has ``count`` rows."""
        self._layout.reset(count)
        self._torque = np.zeros((count, 2))
        self._memory = np.zeros((count, self._memory_size), np.float32)

    def act(self, measurement: Measurement) -> Array:
        """Return joint torques, N m, (n, 2); UsageError for a command out of the trained range."""
        newest, (low, high) = measurement.command[:, 0], self.command_range
        fits = (low - _ROUNDING <= newest) & (newest <= high + _ROUNDING)
        if not fits.all():
            raise UsageError(
                f"{self.name} was trained for commands from {low:g} to {high:g} m, not for"
                f" {newest[~fits][0]:g} m."
            )
        self._layout.update(measurement, self._torque)
        feeds = self._layout.inputs()
        if self._memory_size:
            feeds[MEMORY] = self._memory
        torque, *memory = self._session.run(None, feeds)
        self._memory = memory[0] if memory else self._memory
        self._torque = torque.astype(np.float64)
        return self._torque.copy()

    def outside(self, measurement: Measurement) -> str:
        """Return which input of the first leg is far beyond all that training met, or ""."""
        card = self.card
        values = np.concatenate([measurement.q[0, 0], measurement.qd[0, 0]])
        values[2:] *= np.sqrt(self.scale)
        for name, value, low, high in zip(
            INPUTS, values, card.input_low, card.input_high, strict=False
        ):
            margin = _MARGIN * (high - low)
            if not low - margin <= value <= high + margin:
                return f"{name} {value:.3g}, trained from {low:.3g} to {high:.3g}"
        return ""

    def internals(self) -> dict[str, Array]:
        """Return nothing: a network has no state to show."""
        return {}
