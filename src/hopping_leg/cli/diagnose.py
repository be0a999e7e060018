"""Say in plain words what is wrong with a leg, as far as its recordings tell.

Told are a motor that gives too little, offsets of torque, commands that act late, the hip's zero,
friction that differs by direction or is higher at some angle, play that makes a motor tremble,
noise, and lost measurements, each with what to do. A clamped leg tells most. A knee's play does not
show, as its shank weighs little beside its motor, nor do soft belts.

Examples:
  hop diagnose fixed-base.parquet
  hop diagnose run1.csv.gz run2.csv.gz --robot my_leg.toml --json findings.json
"""

from dataclasses import asdict, dataclass
from pathlib import Path

import tyro

from hopping_leg.cli.options import JsonFile, save_json, say
from hopping_leg.identify.diagnosis import diagnose
from hopping_leg.identify.plan import robot_of
from hopping_leg.identify.recording import load_recording
from hopping_leg.progress import said_if_slow
from hopping_leg.robot import load_robot


@dataclass(frozen=True)
class Diagnose:
    """What to judge."""

    recordings: tyro.conf.Positional[tuple[Path, ...]]
    """Recordings of one leg: Parquet, or CSV with a sidecar or of a known rig."""
    robot: str | None = None
    """A shipped robot or a .toml file; default: the recordings' own."""
    json: JsonFile = None


def run(args: Diagnose) -> None:
    """Judge each recording by itself."""
    recordings = [load_recording(path) for path in args.recordings]
    robot = load_robot(args.robot or robot_of(recordings))
    rows = []
    for recording in recordings:
        with said_if_slow(f"Diagnosing {recording.name}."):
            findings = diagnose(recording, robot)
        sentences = [f"  {finding.sentence}" for finding in findings]
        say(f"{recording.name}:", *(sentences or ["  Nothing is wrong that this recording tells."]))
        rows += [{"recording": recording.name, **asdict(finding)} for finding in findings]
    save_json(args.json, {"robot": robot.name, "findings": rows})
