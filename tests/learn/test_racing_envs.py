"""Racing-v0 and RacingBullet-v0: the planner's own physics in every lane, Gymnasium's rules, one
line for wrong use."""

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="the extra rl is not installed")

from gymnasium.error import ResetNeeded  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402

from controllers.lanes.threads import use_threads  # noqa: E402
from controllers.learned.observation import SIZE, UNITS, command, gate_rows, observe  # noqa: E402
from quadsim.dynamics.quadrotor import Control, Params, State, step  # noqa: E402
from quadsim.learn import BULLET, RACING  # noqa: E402
from quadsim.learn.lanes import LaneEnvironments  # noqa: E402
from quadsim.learn.task import task  # noqa: E402
from quadsim.learn.vector_env import RacingVectorEnv  # noqa: E402


def made(n=70, **settings):
    return gymnasium.make_vec(RACING, num_envs=n, **settings)


def flown(envs, steps, seed=5, spread=0.2):
    """Everything that comes back, under random actions around hover."""
    rng, found = np.random.default_rng(seed), [envs.reset(seed=3)[0]]
    for _ in range(steps):
        actions = rng.normal(0, spread, (envs.num_envs, 4)).astype(np.float32)
        *arrays, _info = envs.step(actions)
        found += arrays
    return found


@pytest.mark.parametrize("env_id", [RACING, BULLET])
@pytest.mark.filterwarnings("ignore:.*observation space m.*value is.*infinity")
def test_gymnasiums_own_check_passes(env_id):
    env = gymnasium.make(env_id, randomize=0.5, render_mode="rgb_array")
    check_env(env.unwrapped)
    assert env.observation_space.shape == (SIZE,) == (len(UNITS),)
    env.close()


@pytest.mark.parametrize("env_id", [RACING, BULLET])
def test_human_rendering_shows_the_vehicle_on_a_page_of_this_machine(env_id, caplog):
    env = gymnasium.make(env_id, render_mode="human")
    env.reset(seed=1)
    page = env.unwrapped._renderer if env_id == BULLET else env.unwrapped._envs._renderer
    assert "http://127.0.0.1:" in caplog.text
    for _ in range(9):  # two pictures are at least 40 ms apart
        env.step(np.array([0.0, 0.0, 0.0, 1.0], np.float32))
    (frame,) = page._page._frames
    start = env.unwrapped.task.courses[0].start.position
    assert frame.position[:2] == pytest.approx(start[:2], abs=0.2)
    assert frame.position[2] > start[2] + 1e-4  # full thrust
    assert env.render() is None
    env.close()
    assert page._page is None


def test_another_render_mode_is_refused_in_a_line():
    with pytest.raises(
        ValueError, match=r"render_mode: expected None, 'human' or 'rgb_array', got 'film'"
    ):
        RacingVectorEnv(1, render_mode="film")


def test_every_lane_flies_the_step_of_the_planners_model():
    """Half a second of random flight against quadrotor.step in float64, each vehicle with its own
    parameters."""
    envs = made(start="anywhere", randomize=1.0, autoreset_mode="Disabled").unwrapped
    envs.reset(seed=1)
    e, system, rng = envs.lanes, envs.task.system, np.random.default_rng(0)
    lanes = [0, 17, 63]
    expected = {k: State(*e.X[0, :, k].astype(float)) for k in lanes}
    params = {k: Params(*e.P[0, :, k].astype(float)) for k in lanes}
    assert len(set(params.values())) == len(lanes)
    for _ in range(50):
        actions = rng.uniform(-0.4, 0.4, (envs.num_envs, 4)).astype(np.float32)
        e.rows_to_lanes(actions, envs._actions)
        e.step(envs._actions)
        for k in lanes:
            u = Control(*command(actions[k].astype(float), system.low, system.high))
            expected[k] = step(expected[k], u, params[k], system.dt)
    for k in lanes:
        np.testing.assert_allclose(e.X[0, :, k], expected[k], rtol=2e-4, atol=2e-4)


def test_observations_are_those_of_a_single_flight():
    envs = made(start="anywhere", randomize=1.0, laps=1).unwrapped
    envs.reset(seed=2)
    obs, *_ = envs.step(np.zeros((envs.num_envs, 4)))
    e, rows = envs.lanes, gate_rows(envs.task.courses[0], 1)
    for k in (0, 5, 40):
        x, last = tuple(e.X[0, :, k].astype(float)), e.last[0, :, k].astype(float)
        np.testing.assert_allclose(
            obs[k], observe(x, rows[e.row[0, k]], last), rtol=1e-4, atol=1e-5
        )


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_the_same_seed_gives_the_same_rollout_for_any_number_of_threads(mode):
    steps = 5 if mode == AutoresetMode.DISABLED else 120
    runs = []
    for threads in (1, None):
        use_threads(threads)
        runs.append(
            flown(
                made(200, start="anywhere", randomize=1.0, noise=0.01, autoreset_mode=mode), steps
            )
        )
    assert all(np.array_equal(a, b) for a, b in zip(*runs, strict=True))
    other = made(200, start="anywhere", randomize=1.0, autoreset_mode=mode).reset(seed=4)[0]
    assert not np.array_equal(other, runs[0][0])


def test_an_episode_starts_anew_when_its_mode_says():
    same, following = (made(start="anywhere", autoreset_mode=m) for m in ("SameStep", "NextStep"))
    for envs in (same, following):
        envs.reset(seed=0)
    still = np.full((70, 4), -1.0)  # no thrust: everything falls
    for _ in range(400):
        obs, reward, ended, cut, info = same.step(still)
        if (ended | cut).any():
            break
    done = ended | cut
    assert info["_final_obs"].tolist() == done.tolist()
    assert not np.array_equal(info["final_obs"][done], obs[done])
    assert (reward[ended] < -5).all()  # the crash is paid for
    for _ in range(400):
        obs, reward, ended, cut, info = following.step(still)
        if ended.any():
            break
    before = ended
    obs, reward, ended, cut, info = following.step(still)
    assert (reward[before] == 0).all()
    assert not ended[before].any()
    assert (info["time"][before] == 0).all()


def test_without_autoreset_an_ended_episode_has_to_be_reset_by_its_mask():
    envs = made(start="anywhere", autoreset_mode="Disabled")
    with pytest.raises(ResetNeeded, match=r"step\(\) before reset"):
        envs.step(np.zeros((70, 4)))
    envs.reset(seed=0)
    ended = np.zeros(70, bool)
    while not ended.any():
        _, _, ended, cut, info = envs.step(np.full((70, 4), -1.0))
    with pytest.raises(ResetNeeded, match="has ended: reset it by reset_mask"):
        envs.step(np.zeros((70, 4)))
    time = info["time"]
    envs.reset(options={"reset_mask": ended | cut})
    *_, info = envs.step(np.zeros((70, 4)))
    assert (info["time"][ended] < 0.02).all()
    assert np.allclose(info["time"][~ended], time[~ended] + 0.01)


def test_observations_that_are_kept_stay_as_they_were_and_others_are_reused():
    envs = made(start="anywhere", autoreset_mode="SameStep")
    kept = [envs.reset(seed=0)[0][1:3]]  # a view
    kept += [envs.step(np.zeros((70, 4)))[0] for _ in range(20)]
    copies = [obs.copy() for obs in kept]
    assert all(np.array_equal(a, b) for a, b in zip(kept, copies, strict=True))
    assert len({obs.ctypes.data for obs in kept}) == 21
    del kept
    assert len({envs.step(np.zeros((70, 4)))[0].ctypes.data for _ in range(20)}) < 4


def test_rewards_of_progress_add_up_to_the_way_flown():
    weights = dict.fromkeys(("crash", "clearance", "body_rates", "action_change"), 0.0)
    envs = made(reward=weights, autoreset_mode="Disabled").unwrapped
    envs.reset(seed=0)
    up = np.zeros((70, 4))
    collected = 0.0
    ways = []
    for _ in range(40):
        _, reward, *_ = envs.step(up)
        collected += reward[0]
        ways.append(envs.lanes.way[0, 0])
    assert collected == pytest.approx(ways[0] - ways[-1], abs=1e-3)
    assert collected != 0


def test_a_gate_is_passed_as_the_referee_sees_it_and_pybullet_flies_the_same():
    """The model against PyBullet with actuators over .5 s of the same random commands: within .15
    m, 1 m/s."""
    lanes, bullet = gymnasium.make(RACING), gymnasium.make(BULLET)
    lanes.reset(seed=0)
    bullet.reset(seed=0)
    rng = np.random.default_rng(1)
    for _ in range(50):
        action = np.clip(rng.normal([0, 0, 0, -0.3], 0.15), -1, 1).astype(np.float32)
        lanes.step(action)
        bullet.step(action)
    ours, theirs = (
        lanes.unwrapped._envs.lanes.X[0, :6, 0],
        np.array(bullet.unwrapped._plant.state.x[:6]),
    )
    assert np.abs(ours[:3] - theirs[:3]).max() < 0.15
    assert np.abs(ours[3:] - theirs[3:]).max() < 1.0
    assert np.abs(theirs[3:]).max() > 0.5  # it moved


def test_several_courses_fly_side_by_side():
    names = ["split_s_swift", "figure8", "paper_flat"]
    envs = LaneEnvironments(task(names, "swift"), 192)
    envs.begin(0)
    for _ in range(3):
        envs.step(np.zeros_like(envs.last))
    starts = np.array([c.start.position for c in task(names, "swift").courses])
    np.testing.assert_allclose(envs.X[:, :2, 0], starts[:, :2], atol=0.05)
    assert not (envs.crashed & (envs.steps < 2)).any()


def test_a_vehicle_far_from_every_obstacle_misses_none():
    """Who looks at the obstacles only where the room to them is used up crashes as who looks at
    each step."""
    every, some, none = (
        LaneEnvironments(task("split_s_swift", "swift", start="anywhere"), 640) for _ in range(3)
    )
    actions = np.random.default_rng(0).normal(0, 0.15, every.last.shape).astype(np.float32)
    actions[:, 3] -= 0.4
    for envs in (every, some, none):
        envs.begin(0)
    for _ in range(120):
        every.room[:], none.room[:] = 0.0, 1e9
        for envs in (every, some, none):
            envs.step(actions)
        assert np.array_equal(every.crashed, some.crashed)
    assert np.array_equal(every.X, some.X)
    assert (every.over & ~none.over).any()  # some touched an obstacle, and nothing else


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"course": "nowhere"}, "nowhere"),
        ({"vehicle": "swifd"}, "swift"),
        ({"num_envs": 0}, "num_envs: expected a whole number of at least 1, got 0"),
        ({"start": "inside"}, "start: expected one of standing, anywhere"),
        ({"laps": 0}, "laps: expected a whole number"),
        ({"course": "paper_flat", "laps": 2}, "expected 1 lap"),
        ({"reward": {"speed": 1}}, "reward: expected RewardWeights or weights of progress"),
        ({"gravity": 3}, "gravity: no such setting of an environment"),
        ({"randomize": -1}, r"randomize: expected a number in 0 \.\. 3"),
        ({"autoreset_mode": "soon"}, "autoreset_mode: expected one of NextStep"),
        (
            {"course": ["figure8", "split_s_swift", "alphapilot"]},
            "expected at least 129 environments for 3",
        ),
    ],
)
def test_a_wrong_setting_is_one_line(settings, said):
    with pytest.raises(ValueError, match=said) as error:
        made(**({"n": settings.pop("num_envs")} if "num_envs" in settings else {}), **settings)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("actions", "said"),
    [
        (np.zeros((3, 4)), r"action: expected shape \(70, 4\), got \(3, 4\)"),
        (np.full((70, 4), np.nan), r"action\[0, 0\]: expected a finite number in -1..1, got nan"),
        ("hover", "action: expected numbers"),
    ],
)
def test_a_wrong_action_is_one_line(actions, said):
    envs = made()
    envs.reset(seed=0)
    with pytest.raises(ValueError, match=said):
        envs.step(actions)


@pytest.mark.parametrize("env_id", [RACING, BULLET])
@pytest.mark.parametrize(
    ("action", "said"),
    [(np.zeros(3), r"expected shape \(4,\), got \(3,\)"), (np.full(4, np.nan), "got nan")],
)
def test_a_wrong_action_of_one_vehicle_is_one_line(env_id, action, said):
    env = gymnasium.make(env_id, disable_env_checker=True)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=said):
        env.step(action)
    env.close()
