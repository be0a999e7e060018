import math
from types import SimpleNamespace

import pytest

from hopping_leg.deploy.drive_link import DriveMode
from studies.fault_campaign.verdict import (
    Limits,
    problems_of_commands,
    reaction,
    restarts,
)
from studies.fault_campaign.wire_log import CommandEvent, ReplyEvent

LIMITS = Limits((10.0, 10.0), (18.0, 42.0), 65.0)


def told(time, mode=DriveMode.POSITION, torque=1.0, most=10.0, joint=0):
    return CommandEvent(time, joint, mode, torque, most)


def answered(time, mode=DriveMode.POSITION, voltage=24.0, temperature=30.0):
    return ReplyEvent(time, 0, mode, 0, voltage, temperature)


def log(*entries):
    answers = [e for e in entries if isinstance(e, ReplyEvent)]
    return SimpleNamespace(
        commands=[e for e in entries if isinstance(e, CommandEvent)],
        answers=lambda since: (e for e in answers if e.time >= since),
    )


def test_healthy_commands_are_no_problem():
    commands = [
        told(0.0, torque=10.0),
        told(0.1, torque=-10.0),
        told(0.2, DriveMode.BRAKE, 0.0, 0.0),
    ]
    assert problems_of_commands(commands, LIMITS) == []


@pytest.mark.parametrize(
    ("command", "word"),
    [
        (told(0.5, torque=math.nan), "no number"),
        (told(0.5, torque=math.inf), "no number"),
        (told(0.5, most=math.nan), "no number"),
        (told(0.5, torque=10.1), "limit 10"),
        (told(0.5, torque=-10.1), "limit 10"),
        (told(0.5, most=11.0), "limit 10"),
    ],
)
def test_every_unsafe_command_is_found(command, word):
    (problem, *_) = problems_of_commands([told(0.0), command], LIMITS)
    assert word in problem


def test_torque_after_a_stop_is_a_restart_only_since_the_fault():
    before = [told(0.0, DriveMode.STOPPED), told(0.1)]
    assert restarts([*before, told(0.6, DriveMode.BRAKE), told(0.7, DriveMode.STOPPED)], 0.5) == []
    assert restarts([*before, told(0.6, DriveMode.BRAKE), told(0.7)], 0.5)


@pytest.mark.parametrize(
    "bad",
    [
        answered(1.0, DriveMode.FAULT),
        answered(1.0, DriveMode.TIMEOUT),
        answered(1.0, voltage=43.0),
        answered(1.0, voltage=17.0),
        answered(1.0, temperature=66.0),
        answered(1.0, temperature=math.nan),
    ],
)
def test_the_reaction_counts_from_the_first_bad_answer_to_the_first_safe_command(bad):
    entries = (
        answered(0.9),
        bad,
        answered(1.1, DriveMode.FAULT),
        told(1.0),
        told(1.003, DriveMode.BRAKE),
    )
    assert reaction(log(*entries), LIMITS, 0.5, jumped=False) == pytest.approx(0.003)


def test_answers_after_the_stop_are_not_reacted_to():
    entries = answered(0.9), told(1.0, DriveMode.BRAKE), answered(1.1, DriveMode.BRAKE)
    assert reaction(log(*entries), LIMITS, 0.5, jumped=False) is None
    assert reaction(log(*entries), LIMITS, 0.5, jumped=True) == pytest.approx(0.1)


def test_no_reaction_is_infinite():
    assert (
        reaction(log(answered(1.0, DriveMode.FAULT), told(1.1)), LIMITS, 0.5, jumped=False)
        == math.inf
    )


def test_an_answer_of_the_instant_at_which_a_jump_begins_knows_nothing_of_it():
    entries = answered(0.5), answered(0.505), told(0.5055, DriveMode.BRAKE)
    assert reaction(log(*entries), LIMITS, 0.5, jumped=True) == pytest.approx(0.0005)
