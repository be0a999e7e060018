import copy
import pickle
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from hopping_leg import ENV_ID
from hopping_leg.envs import ApexRewardConfig, TaskConfig, apex_reward
from hopping_leg.errors import UsageError
from hopping_leg.robot import DEFAULT_ROBOT, load_robot
from hopping_leg.sim import NO_NOISE
from hopping_leg.sim.randomization import WIDE_RANGES

RANDOM = TaskConfig(
    episode=0.1, observation="dated", reset_distribution="mixed", command_range=(0.22, 0.4),
    command_resampling_time=(0.02, 0.05), randomised=WIDE_RANGES,
)  # fmt: skip
APEX = apex_reward(load_robot(DEFAULT_ROBOT), ApexRewardConfig(), 200.0)  # A reward that remembers
SINGLE, VECTOR, SYNC = "single", "vector_entry_point", "sync"
MODES = [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP]
KINDS = [SINGLE, VECTOR, SYNC, pytest.param("async", marks=pytest.mark.slow)]


def make(kind, count=2, **words):
    words = {"options": RANDOM, "reward": APEX, **words}
    if kind == SINGLE:
        return gymnasium.make(ENV_ID, **words)
    return gymnasium.make_vec(ENV_ID, count, vectorization_mode=kind, **words)


def plan(env, ticks=45, seed=7):
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (ticks, *env.action_space.shape)).astype(np.float32)


def play(env, seed=None, actions=None, spoil=lambda seen: None):
    """Return observations and rewards of some ticks as bytes; ``spoil`` gets all that is seen."""
    told = []
    seen = env.reset(seed=seed)
    told.append(seen[0].tobytes())
    for action in plan(env) if actions is None else actions:
        spoil(seen)
        seen = env.step(action)
        told += [seen[0].tobytes(), np.asarray(seen[1]).tobytes()]
        if env.spec.kwargs.get("vectorization_mode") is None and seen[3]:
            told.append(env.reset()[0].tobytes())
    return told


def legs(env):
    """Return what the legs are."""
    inner = getattr(env.unwrapped, "envs", [env])
    return [one.unwrapped.task.legs.table.tobytes() for one in inner]


@pytest.mark.parametrize("kind", KINDS)
def test_everything_random_follows_the_seed(kind):
    env = make(kind)
    told, drawn = [], []
    for seed in (3, 4, None, 3):
        told.append(play(env, seed))
        drawn.append(None if kind == "async" else legs(env))
    assert told[0] == told[3] == play(make(kind), 3)
    assert told[0] != told[1] != told[2]
    assert drawn[1:] == [drawn[1], drawn[1], drawn[0]], "what legs are changes with a seed alone"
    assert kind == "async" or drawn[0] != drawn[1]
    env.close()


def overwrite(seen):
    """Fill every array in what an environment returned."""
    if isinstance(seen, dict):
        seen = tuple(seen.values())
    if isinstance(seen, tuple):
        for part in seen:
            overwrite(part)
    elif isinstance(seen, np.ndarray):
        seen[...] = None if seen.dtype == object else 1


@pytest.mark.parametrize(
    ("kind", "words"), [(SINGLE, {}), *((VECTOR, {"autoreset_mode": mode}) for mode in MODES)]
)
def test_arrays_belong_to_the_caller(kind, words):
    assert play(make(kind, **words), 3, spoil=overwrite) == play(make(kind, **words), 3)


@pytest.mark.parametrize("kind", [SINGLE, VECTOR])
@pytest.mark.parametrize("wrong", [np.nan, np.inf, "shape", "text", "more", None])
def test_an_action_without_meaning_is_refused_and_nothing_has_moved(kind, wrong):
    env, twin = make(kind), make(kind)
    good = plan(env)[0]
    bad = {"shape": good.ravel()[:1], "text": "left", "more": np.stack([good] * 3), None: None}
    for one in (env, twin):
        one.reset(seed=0)
    with pytest.raises((UsageError, ValueError), match=r"Actions.*not|could not convert"):
        env.step(bad[wrong] if wrong in bad else np.where(np.arange(2) == 1, wrong, good))
    assert env.step(good)[0].tobytes() == twin.step(good)[0].tobytes()


@pytest.mark.parametrize("kind", [SINGLE, VECTOR])
@pytest.mark.parametrize("form", [np.ndarray.tolist, torch.tensor, np.float64])
def test_actions_may_be_lists_and_tensors(kind, form):
    usual, other = (
        play(make(kind, disable_env_checker=True) if kind == SINGLE else make(kind), 0, actions)
        for actions in (plan(make(kind)), [form(a) for a in plan(make(kind))])
    )
    assert usual == other


@pytest.mark.parametrize("kind", [SINGLE, VECTOR])
def test_words_without_meaning_are_refused(kind):
    with pytest.raises(UsageError, match=r"no render mode 'ansi'.*rgb_array"):
        make(kind, render_mode="ansi")
    env = make(kind)
    for options in ({"height": 0.3}, {"command": -1}, {"command": [0.3] * 5}):
        with pytest.raises(UsageError, match="command"):
            env.reset(options=options)
    with pytest.raises(UsageError, match="autoreset mode"):
        make(VECTOR, autoreset_mode=AutoresetMode.DISABLED)
    with pytest.raises(UsageError, match="episode"):
        make(VECTOR, max_episode_steps=0)


@pytest.mark.parametrize("kind", [SINGLE, VECTOR])
@pytest.mark.parametrize("take", [copy.deepcopy, pickle.dumps])
def test_a_copy_is_refused(kind, take):
    with pytest.raises(UsageError, match=r"task\.restore\(.*task\.state"):
        take(make(kind).unwrapped)


@pytest.mark.parametrize("kind", [SINGLE, VECTOR])
def test_a_given_command_holds_for_its_episode(kind):
    env = make(kind)
    _, info = env.reset(seed=0, options={"command": 0.28})
    told = [info["command"], *(env.step(a)[4]["command"] for a in plan(env, 19))]
    assert (np.array(told) == 0.28).all()
    _, info = env.reset()
    assert (np.array(info["command"]) != 0.28).all()


def same(ours, theirs):
    """Compare infos where their masks say that there is something."""
    keys = {k for k in (*ours, *theirs) if not k.startswith("_")}
    for key in keys:
        nothing = np.zeros(2, bool)
        mask, other = (np.asarray(i.get(f"_{key}", nothing)) for i in (ours, theirs))
        np.testing.assert_array_equal(mask, other, err_msg=key)
        if not mask.any():
            continue
        if key == "final_info":  # all others hold a row for each leg, as TorchRL asks for
            same(ours[key], theirs[key])
        else:
            for mine, yours in zip(ours[key][mask], theirs[key][mask], strict=True):
                np.testing.assert_allclose(mine, yours, rtol=1e-6, err_msg=key)


@pytest.mark.parametrize("mode", MODES)
def test_the_vector_environment_does_as_gymnasiums_own(mode):
    options = TaskConfig(
        episode=0.2, commands=(0.3,), disturbance=NO_NOISE, fall_clearance=0.06, fall_penalty=1.0
    )
    words = {"options": options, "reward": APEX}
    ours = make(VECTOR, autoreset_mode=mode, **words)
    theirs = make(SYNC, vector_kwargs={"autoreset_mode": mode}, **words)
    assert ours.autoreset_mode == mode
    ends, one, other = np.zeros(2), ours.reset(seed=0), theirs.reset(seed=0)
    np.testing.assert_array_equal(one[0], other[0])
    same(one[1], other[1])
    for tick in range(150):
        push = np.array([[-0.6, 0.5], [0.1, 0.2]], np.float32) * (-1) ** (tick // 15)
        one, other = ours.step(push), theirs.step(push)
        assert [part.dtype for part in one[:4]] == [part.dtype for part in other[:4]]
        assert ours.observation_space.contains(one[0])
        for part, others in zip(one[:4], other[:4], strict=True):
            np.testing.assert_allclose(part, others, rtol=1e-9)
        same(one[4], other[4])
        ended = one[2] | one[3]
        ends += ended
    assert (ends > 2).all()
    assert ends[0] != ends[1], "one leg fell, one had its time"


@pytest.mark.parametrize("kind", [SINGLE, VECTOR, SYNC])
@pytest.mark.parametrize(("most", "ticks"), [(7, 7), (99, 20), (None, 20)])
def test_an_episode_has_at_most_the_steps_that_gymnasium_is_told(kind, most, ticks):
    env = make(kind, max_episode_steps=most)
    assert kind == SYNC or env.spec.max_episode_steps in (most, ticks), "what wrappers read"
    env.reset(seed=0)
    ended = [np.all(env.step(action)[3]) for action in plan(env, ticks)]
    assert np.flatnonzero(ended).tolist() == [ticks - 1]


@pytest.mark.filterwarnings("error", "ignore:.*infinity")
def test_the_environment_passes_gymnasiums_checker():
    check_env(env := gymnasium.make(ENV_ID).unwrapped, skip_render_check=True)
    assert np.isinf(env.observation_space.high).all(), "wrappers would rescale by any other bound"


@pytest.mark.parametrize(
    "words",
    [
        "import gymnasium; gymnasium.make('hopping_leg:HoppingLeg-v0')",
        "import hopping_leg, gymnasium; gymnasium.make_vec('HoppingLeg-v0', num_envs=2)",
        "import hopping_leg, sys; assert not {'mujoco', 'torch'} & set(sys.modules)",
    ],
)
def test_gymnasium_knows_it_by_its_package_or_its_import(words):
    subprocess.run([sys.executable, "-W", "error::UserWarning", "-c", words], check=True)
