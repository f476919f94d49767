"""Racing-v0 and RacingBullet-v0: the planner's physics in every lane under Gymnasium's rules."""

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="the extra rl is not installed")

from gymnasium.error import ResetNeeded  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402

from quadsim.controllers.lanes.threads import most_threads  # noqa: E402
from quadsim.controllers.learned.observation import SIZE, UNITS, command, gate_rows, observe  # noqa: E402
from quadsim.dynamics.quadrotor import Control, Params, State, step  # noqa: E402
from quadsim.learn import BULLET, RACING  # noqa: E402
from quadsim.learn.lanes import (  # noqa: E402
    LaneEnvironments,
)
from quadsim.learn.render import FRAME, HEIGHT, HIGH, LOW, WIDTH, picture  # noqa: E402
from quadsim.learn.task import task  # noqa: E402
from quadsim.learn.vector_env import RacingVectorEnv  # noqa: E402

FULL_THRUST = np.array([0.0, 0.0, 0.0, 1.0], np.float32)


def made(n=70, **settings):
    return gymnasium.make_vec(RACING, num_envs=n, **settings)


def flown(envs, steps, seed=5, spread=0.2):
    """Return everything that comes back, under random actions around hover."""
    rng = np.random.default_rng(seed)
    found = [envs.reset(seed=3)[0]]
    for _ in range(steps):
        actions = rng.normal(0, spread, (envs.num_envs, 4)).astype(np.float32)
        *arrays, _info = envs.step(actions)
        found += arrays
    return found


@pytest.mark.compiled
@pytest.mark.parametrize("env_id", [RACING, BULLET])
@pytest.mark.filterwarnings("error")
def test_gymnasiums_own_check_passes(env_id):
    # the check makes an environment in each render mode, with the same viewer
    env = gymnasium.make(env_id, randomize=0.5, render_mode="rgb_array", viewer=RecordingViewer)
    check_env(env.unwrapped)
    assert env.observation_space.shape == (SIZE,) == (len(UNITS),)
    env.close()


class RecordingViewer:
    """A viewer that keeps what it is shown."""

    def __init__(self, course, vehicles, dt):
        self.course, self.vehicles, self.dt = course, vehicles, dt
        self.shown = []
        self.closed = False

    def show(self, states):
        self.shown.append(states.copy())

    def close(self):
        self.closed = True


@pytest.mark.compiled
@pytest.mark.parametrize("env_id", [RACING, BULLET])
def test_a_viewer_sees_every_step(env_id):
    viewers = []

    def viewer(*args):
        viewers.append(RecordingViewer(*args))
        return viewers[-1]

    env = gymnasium.make(env_id, viewer=viewer)
    env.reset(seed=1)
    for _ in range(9):
        env.step(FULL_THRUST)
    env.close()
    (seen,) = viewers
    course = env.unwrapped.task.courses[0]
    assert (seen.course, seen.vehicles, seen.dt) == (course, 1, 0.01)
    assert np.shape(seen.shown) == (10, 1, 10)
    assert seen.shown[0][0, :2] == pytest.approx(course.start.position[:2], abs=0.2)
    assert seen.shown[-1][0, 2] > seen.shown[0][0, 2]
    assert seen.closed


@pytest.mark.socket
@pytest.mark.compiled
def test_the_page_shows_the_vehicle_on_this_machine(caplog):
    from quadsim.web.page.env_page import EnvPage

    env = gymnasium.make(RACING, viewer=EnvPage)
    env.reset(seed=1)
    page = env.unwrapped._envs._renderer._viewer
    assert "http://127.0.0.1:" in caplog.text
    for _ in range(9):  # two pictures are at least 40 ms apart
        env.step(FULL_THRUST)
    (frame,) = page._frames
    start = env.unwrapped.task.courses[0].start.position
    assert frame.position[:2] == pytest.approx(start[:2], abs=0.2)
    assert frame.position[2] > start[2] + 1e-4
    assert env.render() is None
    env.close()


def test_the_mode_human_is_that_of_gymnasium():
    with pytest.raises(ValueError, match=r"gymnasium\.make opens a window; viewer=quadsim.web"):
        RacingVectorEnv(1, render_mode="human")


def test_a_picture_shows_gates_and_each_vehicle_where_it_is():
    course = task("split_s_swift").courses[0]
    (x_low, x_high), (y_low, y_high), (z_low, z_high) = course.bounds
    middle = np.array([(x_low + x_high) / 2, (y_low + y_high) / 2, z_high])
    states = np.zeros((2, 10))
    states[:, :3] = middle, (x_high, y_high, z_low)
    seen = picture(course, states)
    assert seen.shape == (HEIGHT, WIDTH, 3)
    assert tuple(seen[HEIGHT // 2, WIDTH // 2]) == tuple(HIGH)
    rows, columns = np.nonzero((seen == LOW).all(axis=2))
    assert rows.max() < HEIGHT / 2
    assert columns.min() > WIDTH / 2
    assert (seen == FRAME).all(axis=2).sum() > 20 * len(set(course.gates))


def test_another_render_mode_is_refused():
    with pytest.raises(ValueError, match="render_mode: "):
        RacingVectorEnv(1, render_mode="film")


@pytest.mark.compiled
def test_every_lane_flies_the_step_of_the_planners_model():
    """Half a second of random flight is that of quadrotor.step in float64.

    Each vehicle has its own parameters.
    """
    envs = made(start="anywhere", randomize=1.0, autoreset_mode="Disabled").unwrapped
    envs.reset(seed=1)
    e = envs.lanes
    system = envs.task.system
    rng = np.random.default_rng(0)
    lanes = [0, 17, 63]
    expected = {k: State(*e.X[0, :, k].astype(float)) for k in lanes}
    params = {k: Params(*e.episodes.models[0, :, k].astype(float)) for k in lanes}
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


@pytest.mark.compiled
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


@pytest.mark.compiled
@pytest.mark.parametrize(
    "mode",
    [
        AutoresetMode.SAME_STEP,
        pytest.param(AutoresetMode.NEXT_STEP, marks=pytest.mark.regression),
        pytest.param(AutoresetMode.DISABLED, marks=pytest.mark.regression),
    ],
)
def test_the_same_seed_gives_the_same_rollout_for_any_number_of_threads(mode, on_threads):
    steps = 5 if mode == AutoresetMode.DISABLED else 60
    settings = {"start": "anywhere", "randomize": 1.0, "autoreset_mode": mode}
    runs = [
        on_threads(threads, lambda: flown(made(200, noise=0.01, **settings), steps))
        for threads in (1, most_threads())
    ]
    assert all(np.array_equal(a, b) for a, b in zip(*runs, strict=True))
    other = made(200, **settings).reset(seed=4)[0]
    assert not np.array_equal(other, runs[0][0])


@pytest.mark.compiled
def test_an_episode_starts_anew_when_its_mode_says():
    same = made(start="anywhere", autoreset_mode="SameStep")
    following = made(start="anywhere", autoreset_mode="NextStep")
    same.reset(seed=0)
    following.reset(seed=0)
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


@pytest.mark.compiled
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


@pytest.mark.compiled
def test_observations_that_are_kept_stay_as_they_were():
    envs = made(start="anywhere", autoreset_mode="SameStep")
    kept = [envs.reset(seed=0)[0]]
    kept += [envs.step(np.zeros((70, 4)))[0] for _ in range(20)]
    copies = [obs.copy() for obs in kept[:-1]]
    envs.step(np.ones((70, 4)))
    assert all(np.array_equal(a, b) for a, b in zip(kept, copies, strict=False))


@pytest.mark.compiled
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


@pytest.mark.compiled
def test_pybullet_flies_nearly_as_the_model_does():
    """Over .5 s of the same random commands, PyBullet is within .15 m and 1 m/s of the model."""
    lanes, bullet = gymnasium.make(RACING), gymnasium.make(BULLET)
    lanes.reset(seed=0)
    bullet.reset(seed=0)
    rng = np.random.default_rng(1)
    for _ in range(50):
        action = np.clip(rng.normal([0, 0, 0, -0.3], 0.15), -1, 1).astype(np.float32)
        lanes.step(action)
        bullet.step(action)
    ours = lanes.unwrapped._envs.lanes.X[0, :6, 0]
    theirs = np.array(bullet.unwrapped._plant.state.x[:6])
    assert np.abs(ours[:3] - theirs[:3]).max() < 0.15
    assert np.abs(ours[3:] - theirs[3:]).max() < 1.0
    assert np.abs(theirs[3:]).max() > 0.5  # it moved


@pytest.mark.compiled
def test_several_courses_fly_side_by_side():
    names = ["split_s_swift", "figure8", "paper_flat"]
    envs = LaneEnvironments(task(names, "swift"), 192)
    envs.begin(0)
    for _ in range(3):
        envs.step(np.zeros_like(envs.last))
    starts = np.array([c.start.position for c in task(names, "swift").courses])
    np.testing.assert_allclose(envs.X[:, :2, 0], starts[:, :2], atol=0.05)
    assert not (envs.crashed & (envs.steps < 2)).any()


@pytest.mark.compiled
def test_a_vehicle_far_from_every_obstacle_misses_none():
    """Obstacles tested only where the room to them is used up are hit as if tested every step."""
    anywhere = task("split_s_swift", "swift", start="anywhere")
    every, some, none = (LaneEnvironments(anywhere, 640) for _ in range(3))
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
    ("settings", "problem"),
    [
        ({"course": "nowhere"}, "nowhere"),
        ({"vehicle": "swifd"}, "swift"),
        ({"n": 0}, "num_envs: .* got 0"),
        ({"start": "inside"}, "start: expected 'anywhere' or 'standing'"),
        ({"laps": 0}, "laps: .* got 0"),
        ({"course": "paper_flat", "laps": 2}, "1 lap"),
        ({"reward": {"speed": 1}}, "reward: .*speed"),
        ({"gravity": 3}, "gravity: "),
        ({"randomize": -1}, "randomize: .* got -1"),
        ({"autoreset_mode": "soon"}, "autoreset_mode: .*NextStep"),
        ({"course": ["figure8", "split_s_swift", "alphapilot"]}, "course: .*129 environments"),
    ],
)
def test_a_wrong_setting_is_one_line(settings, problem):
    with pytest.raises(ValueError, match=problem) as error:
        made(**settings)
    assert "\n" not in str(error.value)


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("actions", "problem"),
    [
        (np.zeros((3, 4)), r"action: .*\(70, 4\), got \(3, 4\)"),
        (np.full((70, 4), np.nan), r"action\[0, 0\]: .* got nan"),
        ("hover", "action: .* got str"),
    ],
)
def test_a_wrong_action_is_one_line(actions, problem):
    envs = made()
    envs.reset(seed=0)
    with pytest.raises(ValueError, match=problem):
        envs.step(actions)


@pytest.mark.compiled
@pytest.mark.parametrize("env_id", [RACING, BULLET])
@pytest.mark.parametrize(
    ("action", "problem"),
    [(np.zeros(3), r"\(4,\), got \(3,\)"), (np.full(4, np.nan), "got nan")],
)
def test_a_wrong_action_of_one_vehicle_is_one_line(env_id, action, problem):
    env = gymnasium.make(env_id, disable_env_checker=True)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=problem):
        env.step(action)
    env.close()
