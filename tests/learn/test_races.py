"""Races of several vehicles: each flies as if alone, and the rules stand between them."""

import copy
import pickle
import subprocess
import sys
import textwrap
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the extra rl is not installed")
pytest.importorskip("pettingzoo", reason="the extra rl is not installed")

from gymnasium.error import ResetNeeded
from pettingzoo.test import parallel_api_test, parallel_seed_test

from quadsim.controllers.lanes.environment import DISABLED
from quadsim.controllers.lanes.threads import most_threads
from quadsim.controllers.learned.observation import LENGTH, SIZE, SPEED
from quadsim.controllers.learned.opponents import OPPONENT_SIZE, OPPONENT_UNITS
from quadsim.controllers.learned.pilot import load_pilot
from quadsim.course import load_course
from quadsim.heat.grid import start_grid
from quadsim.learn import RacingParallelEnv
from quadsim.learn.lanes import LaneEnvironments
from quadsim.learn.race_lanes import RaceLanes
from quadsim.learn.race_task import RaceRewardWeights, nearest_square, race_task
from quadsim.learn.races import Races
from quadsim.learn.reward import RewardWeights
from quadsim.rotation import euler_matrix, from_yaw, matrix

NOTHING_BUT_RANK = dict.fromkeys(
    ("progress", "crash", "clearance", "body_rates", "action_change"), 0.0
)


def around_hover(shape, seed=0, spread=0.2):
    actions = np.random.default_rng(seed).normal(0, spread, shape).astype(np.float32)
    actions[..., 3] -= 0.5
    return actions


def opponents(obs):
    """Return what is observed of the opponents.  (..., racers - 1, OPPONENT_SIZE)"""
    return obs[..., SIZE:].reshape(*obs.shape[:-1], -1, OPPONENT_SIZE)


def placed(env, positions, velocities):
    """Put the racers of a ParallelEnv into the air, level, north of the course's first gate."""
    lanes = env._races.lanes
    for a, (p, v) in enumerate(zip(positions, velocities, strict=True)):
        lanes.X[a, :3, 0] = p
        lanes.X[a, 3:6, 0] = v
        lanes.X[a, 6:10, 0] = from_yaw(0.3 * a)
        lanes.X[a, 10:13, 0] = 0.0
    return lanes


def hover(env):
    return {agent: np.array([0, 0, 0, -0.5], np.float32) for agent in env.agents}


# PettingZoo


@pytest.mark.compiled
@pytest.mark.filterwarnings("error")
def test_pettingzoos_own_checks_pass():
    settings = {"racers": 3, "randomize": 0.5}
    # The first race is over within these steps.
    parallel_api_test(RacingParallelEnv("split_s_swift", **settings), 200)
    parallel_seed_test(lambda: RacingParallelEnv("split_s_swift", **settings), 20)


@pytest.mark.compiled
def test_a_racer_that_is_out_leaves_the_agents_and_the_others_fly_on():
    env = RacingParallelEnv("figure8", racers=3, time_limit=2.0)
    env.reset(seed=0)
    assert env.agents == env.possible_agents == ["racer_0", "racer_1", "racer_2"]
    left = []
    while env.agents:
        actions = hover(env)
        if "racer_1" in actions:
            actions["racer_1"] = np.array([0, 0, 0, -1], np.float32)  # it falls
        before = list(env.agents)
        obs, rewards, ended, cut, infos = env.step(actions)
        for found in (obs, rewards, ended, cut, infos):
            assert list(found) == before
        gone = [agent for agent in before if agent not in env.agents]
        assert gone == [agent for agent in before if ended[agent] or cut[agent]]
        if gone:
            left.append(gone)
            seen = {agent: opponents(obs[agent])[:, 0].sum() for agent in env.agents}
            assert all(count == len(env.agents) - 1 for count in seen.values())
        if gone == ["racer_1"]:
            assert infos["racer_1"]["crashed"]
            assert not infos["racer_1"]["collided"]
            resting = env._races.lanes.X[1, :, 0].copy()
    assert left[0] == ["racer_1"]
    np.testing.assert_array_equal(env._races.lanes.X[1, :, 0], resting)
    with pytest.raises(ResetNeeded, match=r"no racer flies: reset\(\)"):
        env.step({})


@pytest.mark.compiled
def test_all_racers_are_cut_at_the_same_time_limit():
    env = RacingParallelEnv("figure8", racers=4, time_limit=0.3)
    env.reset(seed=0)
    for _ in range(30):
        assert len(env.agents) == 4
        _, _, ended, cut, infos = env.step(hover(env))
    assert all(cut.values())
    assert not any(ended.values())
    assert env.agents == []
    assert all(info["time"] == pytest.approx(0.3) for info in infos.values())


# The rules


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("miss", "distance", "collide"),
    [(0.05, 0.1, True), (0.15, 0.1, False), (0.15, 0.2, True), (0.0, 0.0, False)],
)
def test_two_racers_on_a_collision_course_are_both_out(miss, distance, collide):
    """They pass each other between two steps, at 60 m/s; a third that is far flies on."""
    env = RacingParallelEnv("figure8", racers=3, collision_distance=distance)
    env.reset(seed=0)
    lanes = placed(
        env,
        [(10.15, 10.0, 6.0), (-12.0, -12.0, 6.0), (10.45, 10.0 + miss, 6.0)],
        [(30.0, 0.0, 0.0), (0.0, 0.0, 0.0), (-30.0, 0.0, 0.0)],
    )
    before = lanes.X[:, :3, 0].copy()
    _, rewards, ended, _, infos = env.step(hover(env))
    after = lanes.X[:, :3, 0].copy()
    # at neither end of the step are they near: only the way between tells
    for positions in (before, after):
        assert np.linalg.norm(positions[0] - positions[2]) > 0.25
    out = {agent for agent, info in infos.items() if info["collided"]}
    assert out == ({"racer_0", "racer_2"} if collide else set())
    assert out == {agent for agent in ended if ended[agent]}
    assert out == {agent for agent in infos if infos[agent]["crashed"]}
    assert env.agents == [agent for agent in env.possible_agents if agent not in out]
    assert all((rewards[agent] < -5) == (agent in out) for agent in rewards)
    assert not any(info["finished"] for info in infos.values())


@pytest.mark.compiled
def test_a_racer_that_is_out_stops_nobody():
    env = RacingParallelEnv("figure8", racers=2)
    env.reset(seed=0)
    placed(env, [(10.0, 10.0, 0.14), (10.0, 10.0, 6.0)], [(0, 0, -5.0), (0, 0, 0)])
    env.step(hover(env))
    assert env.agents == ["racer_1"]
    resting = env._races.lanes.X[0, :3, 0].tolist()
    placed(env, [resting, np.add(resting, (0.0, 0.0, 0.2))], [(0, 0, 0), (0, 0, 0)])
    _, _, _, _, infos = env.step({"racer_1": np.array([0, 0, 0, 1.0])})
    assert not infos["racer_1"]["collided"]


def test_the_nearest_point_of_a_line_is_that_of_many_points():
    rng = np.random.default_rng(0)
    shares = np.linspace(0, 1, 2001)[:, None]
    for start, end in rng.normal(size=(50, 2, 3)):
        points = start + shares * (end - start)
        expected = np.square(points).sum(axis=1).min()
        assert nearest_square(start, end) == pytest.approx(expected, abs=1e-5)
    still = np.array([0.1, 0.2, 0.2])
    assert nearest_square(still, still) == pytest.approx(0.09)


# Each racer flies as if it were alone


@pytest.mark.compiled
@pytest.mark.parametrize(
    "start", [pytest.param("standing", marks=pytest.mark.regression), "anywhere"]
)
def test_without_collisions_every_racer_flies_exactly_as_a_vehicle_alone(start):
    """State, own observation and reward are those of the single environment to the last bit."""
    settings = {"randomize": 1.0, "start": start, "collision_distance": 0.0}
    races = RaceLanes(race_task(racers=3, reward={"rank": 0.0}, **settings), 64)
    races.begin(5)
    alone = LaneEnvironments(races.task, len(races.X) * 64, 0, DISABLED)
    alone.begin(5)
    for ours, theirs in zip(races.episodes, alone.episodes, strict=True):
        theirs[:] = ours
    flying = np.ones_like(races.over)
    for step in range(100):
        actions = around_hover((len(races.X), 64, 4), step).transpose(0, 2, 1).copy()
        races.step(actions)
        alone.step(actions)
        now = flying & ~races.over
        here = np.broadcast_to(now[:, None], races.X.shape)
        np.testing.assert_array_equal(races.X[here], alone.X[here])
        np.testing.assert_array_equal(races.reward[flying], alone.reward[flying])
        np.testing.assert_array_equal(races.ended[flying], alone.ended[flying])
        seen = np.broadcast_to(flying[:, None], races.obs.shape)
        np.testing.assert_array_equal(races.obs[seen], alone.obs[seen])
        assert (races.reward[~flying] == 0).all()
        assert (races.obs.transpose(0, 2, 1)[~flying] == 0).all()
        flying = now
    if start == "anywhere":
        assert 10 < flying.sum() < flying.size  # some were out meanwhile


@pytest.mark.compiled
def test_collisions_are_what_makes_races_differ_from_single_flights():
    """The control of the test before: with racers that meet, flights end that went on alone."""
    far, near = (
        Races(64, racers=4, start="anywhere", restart=False, collision_distance=d)
        for d in (0.0, 0.5)
    )
    far.reset(3)
    near.reset(3)
    out = {}
    for name, races in (("far", far), ("near", near)):
        collided = np.zeros((64, 4), bool)
        for step in range(60):
            *_, info = races.step(around_hover((64, 4, 4), step))
            collided |= info["collided"]
        out[name] = collided.sum()
    assert out["far"] == 0
    assert out["near"] > 10


# Observations


@pytest.mark.compiled
def test_opponents_are_observed_where_they_are_nearest_first():
    races = Races(70, racers=4, start="anywhere", randomize=0.5)
    races.reset(seed=1)
    obs, *_ = races.step(around_hover((70, 4, 4)))
    states = races.state_rows().astype(float)
    racing = ~races._by_race(races.lanes.over)
    for race in (0, 13, 69):
        for a in range(4):
            others = [b for b in range(4) if b != a and racing[race, b]]
            away = states[race, others, :6] - states[race, a, :6]
            away = away[np.argsort(np.linalg.norm(away[:, :3], axis=1))]
            turn = matrix(states[race, a, 6:10])
            expected = np.zeros((3, OPPONENT_SIZE))
            expected[: len(others), 0] = 1.0
            expected[: len(others), 1:4] = away[:, :3] @ turn / LENGTH
            expected[: len(others), 4:7] = away[:, 3:] @ turn / SPEED
            np.testing.assert_allclose(
                opponents(obs)[race, a], expected, rtol=1e-4, atol=1e-5 * max(1, LENGTH)
            )
    assert len(OPPONENT_UNITS) == OPPONENT_SIZE


@pytest.mark.compiled
def test_what_two_racers_see_of_each_other_is_opposite_in_the_world():
    races = Races(64, racers=2, start="anywhere")
    obs = races.reset(seed=2)
    states = races.state_rows().astype(float)
    seen = opponents(obs)[:, :, 0]
    turns = np.array([[matrix(state[6:10]) for state in race] for race in states])
    for first in (1, 4):
        in_world = np.einsum("raij,raj->rai", turns, seen[..., first : first + 3])
        np.testing.assert_allclose(in_world[:, 0], -in_world[:, 1], atol=1e-5)
        assert np.abs(in_world).max() > 0.05
        # in their own frames they are not
        own = seen[..., first : first + 3]
        assert np.abs(own[:, 0] + own[:, 1]).max() > 0.01 or first == 4


@pytest.mark.compiled
def test_noise_is_on_what_is_seen_of_opponents_that_are_there():
    exact, noisy = (Races(64, racers=3, start="anywhere", noise=n) for n in (0.0, 0.05))
    for races in (exact, noisy):
        races.reset(seed=0)
    differences = []
    for step in range(80):
        actions = around_hover((64, 3, 4), step)
        clean, *_, info = exact.step(actions)
        seen, *_ = noisy.step(actions)
        racing = info["racing"] & ~info["over"][:, None]
        a, b = opponents(clean)[racing], opponents(seen)[racing]
        np.testing.assert_array_equal(a[..., 0], b[..., 0])
        here = a[..., 0] > 0
        assert (b[~here] == 0).all()
        differences.append((b - a)[here][:, 1:])
    found = np.concatenate(differences)
    assert found.std() == pytest.approx(0.05, rel=0.03)
    assert abs(np.corrcoef(found.T)[np.triu_indices(6, 1)]).max() < 0.05
    assert abs(found.mean()) < 0.002


# Places


def flown_by_pilots(races, steps, spread=0.0):
    """Yield what each step gives, flown by a pilot that sees only its own numbers."""
    pilot = load_pilot("split_s_swift")
    rng = np.random.default_rng(0)
    obs = races.reset(seed=4)
    shape = (races.races, races.racers, 4)
    for step in range(steps):
        if step % pilot.about.hold == 0:
            own = obs.reshape(-1, races.size)[:, :SIZE]
            actions = pilot(own).reshape(shape) + rng.normal(0, spread, shape)
        obs, reward, ended, cut, info = races.step(actions)
        yield obs, reward, ended, cut, info


@pytest.mark.compiled
def test_places_are_those_of_a_plain_sort():
    races = Races(
        4, racers=5, laps=1, randomize=1.0, collision_distance=0.0, restart=False, time_limit=20.0
    )
    finish = np.full((4, 5), np.inf)
    for *_, info in flown_by_pilots(races, 700, spread=0.05):
        finish = np.where(info["finished"], info["time"], finish)
        way = races._by_race(races.lanes.way)
        for race in range(4):
            keys = [(finish[race, a], -info["gates"][race, a], way[race, a]) for a in range(5)]
            expected = np.empty(5, int)
            expected[sorted(range(5), key=lambda a: keys[a])] = np.arange(1, 6)
            np.testing.assert_array_equal(info["rank"][race], expected)
    assert np.isfinite(finish).sum() > 10
    assert (finish.argmin(axis=1) == info["rank"].argmin(axis=1)).all()


@pytest.mark.compiled
def test_places_add_up_and_what_one_gains_another_loses():
    races = Races(
        64, racers=4, start="anywhere", restart=False, reward={**NOTHING_BUT_RANK, "rank": 2.0}
    )
    ranks = []
    moved = 0
    for _, reward, *_, info in flown_by_pilots(races, 200, spread=0.3):
        assert (info["rank"].sum(axis=1) == 10).all()
        if ranks:
            gained = ranks[-1] - info["rank"]
            np.testing.assert_allclose(reward, 2.0 * gained * info["racing"])
            all_fly = info["racing"].all(axis=1)
            assert (reward[all_fly].sum(axis=1) == 0).all()
            moved += (gained != 0).sum()
        else:
            assert (reward == 0).all()
        ranks.append(info["rank"])
    assert moved > 50


@pytest.mark.compiled
def test_a_crash_by_a_collision_is_paid_once():
    weights = {**NOTHING_BUT_RANK, "rank": 0.0, "crash": 3.0}
    races = Races(64, racers=4, start="anywhere", collision_distance=0.5, reward=weights)
    races.reset(seed=0)
    crashes = collisions = 0
    for step in range(100):
        _, reward, ended, _, info = races.step(around_hover((64, 4, 4), step))
        np.testing.assert_array_equal(reward, np.where(info["crashed"], -3.0, 0.0))
        assert (ended == (info["crashed"] | info["finished"])).all()
        assert not (info["collided"] & ~info["crashed"]).any()
        collisions += info["collided"].sum()
        crashes += info["crashed"].sum()
    assert 0 < collisions < crashes


# Starts


@pytest.mark.parametrize("racers", range(2, 9))
def test_racers_start_a_metre_apart_on_an_arc_that_faces_gate_1(racers):
    course = load_course("split_s_swift")
    gate = np.array(course.gates[0].position[:2])
    starts = start_grid(course, racers)
    places = np.array([start.position for start in starts])
    radius = np.linalg.norm(np.array(course.start.position[:2]) - gate)
    for a, start in enumerate(starts):
        row, place = divmod(a, 4)
        to_gate = gate - places[a, :2]
        assert np.linalg.norm(to_gate) == pytest.approx(radius + row)
        heading = np.array((np.cos(start.yaw), np.sin(start.yaw)))
        np.testing.assert_allclose(heading, to_gate / np.linalg.norm(to_gate), atol=1e-9)
        if place:
            beside = places[a] - places[a - 1]
            assert np.linalg.norm(beside) == pytest.approx(1.0)
            # the next one stands on the left
            assert heading[0] * beside[1] - heading[1] * beside[0] > 0.9
    first_row = places[:4].mean(axis=0)
    to_start = np.array(course.start.position) - first_row
    assert np.linalg.norm(to_start) < 0.2
    distances = np.linalg.norm(places[:, None] - places, axis=2)
    assert distances[np.triu_indices(racers, 1)].min() > 0.99


def test_a_row_near_its_gate_is_straight():
    course = load_course("figure8")
    gate = course.gates[0]
    near = replace(gate, position=(-3.5, -3.5, 1.5))
    starts = start_grid(replace(course, gates=(near, *course.gates[1:])), 4)
    assert {start.yaw for start in starts} == {course.start.yaw}
    places = np.array([start.position for start in starts])
    left = euler_matrix(course.start.yaw, 0.0, 0.0)[:, 1]
    np.testing.assert_allclose(np.diff(places, axis=0), np.tile(left, (3, 1)), atol=1e-9)


@pytest.mark.compiled
def test_the_racers_of_a_race_start_on_the_way_to_the_same_gate():
    races = Races(200, racers=4, start="anywhere")
    races.reset(seed=0)
    rows = races._by_race(races.lanes.row)
    assert (rows == rows[:, :1]).all()
    assert len(np.unique(rows)) > 5
    positions = races.state_rows()[..., :3]
    apart = np.linalg.norm(positions[:, :, None] - positions[:, None], axis=3)
    nearest = apart[:, *np.triu_indices(4, 1)].min(axis=1)
    assert (nearest > 0.1).mean() > 0.99
    assert np.median(nearest) < 1.5


@pytest.mark.compiled
def test_racers_have_vehicles_of_their_own():
    races = Races(64, racers=3, randomize=1.0)
    races.reset(seed=0)
    models = races.lanes.episodes.models[:, :, 0]
    assert len({tuple(model) for model in models.tolist()}) == 3


# Series of races


@pytest.mark.compiled
def test_a_race_that_is_over_starts_anew_in_the_same_step():
    races = Races(70, racers=3, start="anywhere")
    races.reset(seed=0)
    overs = 0
    for step in range(300):
        obs, _, ended, cut, info = races.step(around_hover((70, 3, 4), step, 0.4))
        over = info["over"]
        assert ("final_obs" in info) == over.any()
        if over.any():
            final = info["final_obs"]
            assert final.shape == (over.sum(), 3, races.size)
            last = info["racing"][over]
            assert (ended | cut)[over][last].all()
            assert not np.array_equal(final, obs[over])
            # who was out before has nothing to observe, who is out now has
            assert (final[~last] == 0).all()
            assert (final[last] != 0).any(axis=1).all()
            assert (info["time"][over] > 0).all()
            assert (opponents(obs)[over][..., 0] == 1).all()
        overs += over.sum()
    assert overs > 30
    assert not races._by_race(races.lanes.over).all(axis=1).any()


@pytest.mark.compiled
def test_without_restart_races_stay_over():
    races = Races(3, racers=2, restart=False, time_limit=0.1)
    races.reset(seed=0)
    overs = [races.step(np.zeros((3, 2, 4)))[-1]["over"] for _ in range(12)]
    assert np.sum(overs, axis=0).tolist() == [1, 1, 1]
    assert overs[9].all()


@pytest.mark.compiled
def test_the_same_seed_gives_the_same_races_for_any_number_of_threads(on_threads):
    """Races that are over within these steps, and begin anew, included."""
    envs = Races(130, racers=4, start="anywhere", randomize=1.0, noise=0.01, time_limit=0.3)

    def flown():
        found = [envs.reset(seed=3)]
        overs = 0
        for step in range(40):
            *arrays, info = envs.step(around_hover((130, 4, 4), step))
            found += [*arrays, *info.values()]
            overs += info["over"].sum()
        assert overs >= 130
        return found

    runs = [on_threads(threads, flown) for threads in (1, most_threads())]
    assert all(np.array_equal(a, b) for a, b in zip(*runs, strict=True))
    assert not np.array_equal(envs.reset(seed=4), runs[0][0])


@pytest.mark.compiled
def test_a_race_does_not_depend_on_how_many_fly_beside_it():
    few, many = (Races(n, racers=3, start="anywhere", randomize=0.5) for n in (2, 130))
    np.testing.assert_array_equal(few.reset(seed=1), many.reset(seed=1)[:2])
    for step in range(30):
        actions = around_hover((130, 3, 4), step)
        a = few.step(actions[:2])
        b = many.step(actions)
        for ours, theirs in zip(a[:4], b[:4], strict=True):
            np.testing.assert_array_equal(ours, theirs[:2])


@pytest.mark.compiled
def test_several_courses_race_side_by_side():
    races = Races(128, course=["split_s_swift", "figure8"], racers=2)
    obs = races.reset(seed=0)
    starts = [c.start.position[:2] for c in races.task.courses]
    for race, start in ((0, starts[0]), (63, starts[0]), (64, starts[1])):
        middle = races.state_rows()[race, :, :2].mean(axis=0)
        np.testing.assert_allclose(middle, start, atol=0.1)
    assert not np.allclose(obs[0], obs[64])


@pytest.mark.compiled
@pytest.mark.parametrize("way", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_flies_on_as_the_first_does(way):
    env = RacingParallelEnv("figure8", racers=3, randomize=0.5)
    env.reset(seed=1)
    env.step(hover(env))
    other = way(env)
    for _ in range(5):
        ours, theirs = env.step(hover(env)), other.step(hover(other))
        for agent, obs in ours[0].items():
            np.testing.assert_array_equal(obs, theirs[0][agent])
        assert ours[1:] == theirs[1:]


@pytest.mark.compiled
def test_a_picture_shows_the_race():
    env = RacingParallelEnv("figure8", racers=2, render_mode="rgb_array")
    env.reset(seed=0)
    assert env.render().ndim == 3
    env.close()


# Misuse


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"racers": 1}, "racers: expected a whole number >= 2 and <= 8, got 1"),
        ({"racers": 9}, "racers: expected a whole number >= 2 and <= 8, got 9"),
        ({"racers": 2.5}, "racers: expected a whole number"),
        ({"course": "nowhere"}, "nowhere"),
        ({"course": ["figure8", "split_s_swift"]}, "course: "),
        ({"course": "lsy_level2", "racers": 8}, "racers: lsy_level2: no room for 8"),
        ({"collision_distance": -1}, r"collision_distance: expected a number \[m\] >= 0"),
        ({"reward": {"overtaking": 1}}, "reward: expected RaceRewardWeights or .*rank"),
        ({"reward": {"rank": "x"}}, "reward.rank: expected a number"),
        ({"reward": RewardWeights()}, "reward: expected RaceRewardWeights"),
        ({"gravity": 3}, "gravity: no such setting .*racers"),
        ({"render_mode": "film"}, "render_mode: "),
    ],
)
def test_a_wrong_setting_is_one_line(settings, problem):
    with pytest.raises(ValueError, match=problem) as error:
        RacingParallelEnv(**settings)
    assert "\n" not in str(error.value)


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda a: {"racer_0": a["racer_0"]}, "expected one for racer_1, which flies, got none"),
        (lambda a: a | {"racer_7": a["racer_0"]}, "racer_0, racer_1, which fly, got .*racer_7"),
        (lambda a: a | {"racer_1": np.zeros(3)}, r"racer_1: action: expected shape \(4,\)"),
        (lambda a: a | {"racer_1": np.full(4, np.nan)}, "racer_1: action.*got nan"),
        (lambda a: list(a.values()), "expected a dict with an action for each of racer_0"),
    ],
)
def test_a_wrong_action_is_one_line_and_changes_nothing(change, problem):
    env = RacingParallelEnv("figure8", racers=2)
    with pytest.raises(ResetNeeded):
        env.step({})
    env.reset(seed=0)
    before = env._races.lanes.X.copy()
    with pytest.raises(ValueError, match=problem) as error:
        env.step(change(hover(env)))
    assert "\n" not in str(error.value)
    np.testing.assert_array_equal(env._races.lanes.X, before)


@pytest.mark.parametrize(("name", "value"), [("races", 0), ("races", "3"), ("threads", 0)])
def test_a_wrong_number_of_races_or_threads_is_one_line(name, value):
    with pytest.raises(ValueError, match=f"{name}: expected"):
        Races(**{name: value})


def test_a_wrong_seed_is_one_line():
    env = RacingParallelEnv("figure8", racers=2)
    with pytest.raises(ValueError, match="seed: expected a whole number"):
        env.reset(seed=-1)


def test_the_weight_of_places_is_a_field_with_a_range():
    assert RaceRewardWeights(rank=2.0).race_params.rank == 2.0
    with pytest.raises(ValueError, match="rank: expected a number"):
        RaceRewardWeights(rank=float("nan"))


@pytest.mark.process
def test_without_pettingzoo_one_line_names_the_extra():
    program = """
        import sys
        sys.modules["pettingzoo"] = None
        import quadsim.learn
        try:
            quadsim.learn.RacingParallelEnv
        except ImportError as error:
            print(error)
        from quadsim.learn.races import Races
    """
    found = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)],
        capture_output=True,
        text=True,
        check=True,
    )
    line = found.stdout.strip()
    assert line.startswith("RacingParallelEnv: pettingzoo is not installed")
    assert "-m pip install 'gymnasium" in line
    # No package index has this project: whoever took its name there would get the installs.
    assert "quadsim[" not in line
