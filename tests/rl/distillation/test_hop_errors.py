"""What is told of a hop, and when."""

import numpy as np
import pytest

from hopping_leg.rl.distillation.hop_errors import HopErrors

FLIGHT, STANCE = 40, 30


def watch(apexes, commands=None, one=None):
    """Let one leg hop; return what is told in every tick of every hop, (hops, ticks)."""
    one = one or HopErrors(1, 0.005)
    commands = commands or [0.3] * len(apexes)
    told = []
    for apex, command in zip(apexes, commands, strict=True):
        rise = np.sin(np.linspace(0, np.pi, FLIGHT + 1))
        gap = np.concatenate([0.1 * rise[1:-1], np.zeros(STANCE)])
        height = np.concatenate([0.2 + (apex - 0.2) * rise[1:-1], np.full(STANCE, 0.19)])
        told.append(
            [
                one.see(np.array([h]), np.array([g]), np.array([command]), np.zeros(1, bool))[0]
                for h, g in zip(height, gap, strict=True)
            ]
        )
    return np.array(told)


def test_the_last_hops_error_is_told_while_the_foot_stands():
    told = watch([0.31, 0.28])
    landed = FLIGHT - 1
    shown = slice(landed + 6, landed + 22)
    np.testing.assert_allclose(told[0, shown], 0.01, atol=1e-3)
    np.testing.assert_allclose(told[1, shown], -0.02, atol=1e-3)
    told[:, shown] = 0.0
    assert not told.any()


def test_nothing_is_told_once_the_command_has_changed():
    one = HopErrors(1, 0.005)
    watch([0.31], one=one)
    assert watch([0.31], [0.25], one).any()
    for _ in range(FLIGHT):
        one.see(np.array([0.3]), np.array([0.1]), np.array([0.25]), np.zeros(1, bool))
    after = [
        one.see(np.array([0.2]), np.zeros(1), np.array([0.35]), np.zeros(1, bool))[0]
        for _ in range(STANCE)
    ]
    assert not np.any(after)


@pytest.mark.parametrize("ticks", [1, 10])
def test_a_bounce_is_no_hop(ticks):
    one = HopErrors(1, 0.005)
    nobody = np.zeros(1, bool)
    for _ in range(ticks):
        one.see(np.array([0.25]), np.array([0.01]), np.array([0.3]), nobody)
    told = [one.see(np.array([0.2]), np.zeros(1), np.array([0.3]), nobody) for _ in range(40)]
    assert not np.any(told)


def test_a_new_episode_knows_of_no_hop():
    one = HopErrors(1, 0.005)
    for tick in range(FLIGHT):
        one.see(np.array([0.3]), np.array([0.1]), np.array([0.25]), np.array([tick == FLIGHT - 1]))
    told = [
        one.see(np.array([0.2]), np.zeros(1), np.array([0.25]), np.zeros(1, bool))
        for _ in range(40)
    ]
    assert not np.any(told)


def test_it_goes_on_from_its_state():
    first, second = HopErrors(1, 0.005), HopErrors(1, 0.005)
    watch([0.31], one=first)
    second.restore(first.state())
    np.testing.assert_array_equal(watch([0.28], one=first), watch([0.28], one=second))
