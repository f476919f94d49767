"""Policies of one's own as pilots: layers in a file, and any function as a controller."""

import sys
from importlib import import_module
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec import structs

import quadsim
from quadsim.controllers.learned.observation import SIZE
from quadsim.controllers.learned.pilot import load_pilot, pilot_bytes

RNG = np.random.default_rng(0)
SEEN = RNG.normal(size=SIZE).astype(np.float32)
FLIGHT = {"laps": 1, "timeout": 0.3}


def random_layers(*widths):
    """Return layers of random numbers between these widths, as (matrix, bias) in float32."""
    return [
        (
            RNG.normal(size=(a, b), scale=0.2).astype(np.float32),
            RNG.normal(size=b).astype(np.float32),
        )
        for a, b in pairwise(widths)
    ]


ACT = {"tanh": np.tanh, "relu": lambda x: np.maximum(x, 0.0), "identity": lambda x: x}
OUT = {"clip": lambda x: np.clip(x, -1.0, 1.0), "tanh": np.tanh}


@pytest.mark.parametrize("hidden", [(), (8,), (8, 5), (7, 6, 5, 4)])
@pytest.mark.parametrize("activation", ACT)
@pytest.mark.parametrize("output", OUT)
def test_a_network_of_any_depth_is_kept_as_it_is(hidden, activation, output, tmp_path):
    layers = random_layers(SIZE, *hidden, 4)
    kinds = {"activation": activation, "output": output}
    saved = quadsim.save_pilot(layers, tmp_path / "p.npz", vehicle="swift", hold=2, **kinds)
    pilot = quadsim.load_pilot(tmp_path / "p.npz")
    assert pilot.digest == saved.digest
    x = SEEN
    for matrix, bias in layers[:-1]:
        x = ACT[activation](x @ matrix + bias)
    matrix, bias = layers[-1]
    expected = OUT[output](x @ matrix + bias)
    np.testing.assert_array_equal(pilot(SEEN), expected)
    np.testing.assert_allclose(pilot(np.stack([SEEN, SEEN])), [expected] * 2, rtol=1e-5, atol=1e-6)


def test_hidden_layers_may_have_different_activations(tmp_path):
    layers = random_layers(SIZE, 6, 5, 4)
    pilot = quadsim.save_pilot(
        layers, tmp_path / "p.npz", vehicle="swift", activation=["relu", "tanh"]
    )
    (a, a0), (b, b0), (c, c0) = layers
    hidden = np.tanh(np.maximum(SEEN @ a + a0, 0.0) @ b + b0)
    np.testing.assert_array_equal(pilot(SEEN), np.clip(hidden @ c + c0, -1.0, 1.0))


def test_a_saved_pilot_flies_by_its_file(tmp_path):
    layers = random_layers(SIZE, 8, 4)
    pilot = quadsim.save_pilot(layers, tmp_path / "mine.npz", vehicle="swift", hold=2)
    run = quadsim.fly("figure8", pilot=str(tmp_path / "mine.npz"), **FLIGHT)
    assert run.spec["pilot"] == {"name": "mine", "sha256": pilot.digest}
    rates = run.telemetry["wx_cmd"]
    assert (rates[0:20:2] == rates[1:21:2]).all()
    with pytest.raises(quadsim.FileError, match="trained for, swift, got kingfisher"):
        quadsim.fly("figure8", pilot=str(tmp_path / "mine.npz"), vehicle="kingfisher", **FLIGHT)
    assert str(pilot) == ("<Pilot mine: 38-8-4 tanh clip, an action held for 20 ms, vehicle swift>")


def test_a_saved_pilot_can_be_saved_again(tmp_path):
    first = quadsim.save_pilot(random_layers(SIZE, 4), tmp_path / "a.npz", vehicle="swift")
    again = quadsim.save_pilot(first, tmp_path / "b.npz", vehicle="swift")
    assert again.digest == first.digest


class Array(np.ndarray):
    """An array that has what a tensor of PyTorch has."""

    def detach(self):
        return self

    def cpu(self):
        return self


def module(kind, *children, **attributes):
    """Return an object that looks like a module of PyTorch of this class."""
    made = type(kind, (), {"children": lambda self: children})()
    vars(made).update(attributes)
    return made


def linear(layer):
    """Return a Linear of PyTorch, whose weights are (outputs, inputs)."""
    matrix, bias = layer
    return module("Linear", weight=matrix.T.view(Array), bias=bias.view(Array))


def test_networks_of_other_libraries_are_read(tmp_path):
    """A Sequential, and the parts of Stable-Baselines3's PPO, SAC and TD3."""
    first, second, last = random_layers(SIZE, 6, 5, 4)
    hidden = module("Sequential", linear(first), module("ReLU"), linear(second), module("ReLU"))
    end = linear(last)
    squashed = module("Sequential", hidden, end, module("Tanh"))
    ppo = SimpleNamespace(mlp_extractor=SimpleNamespace(policy_net=hidden), action_net=end)
    sac = SimpleNamespace(actor=SimpleNamespace(latent_pi=hidden, mu=end))
    td3 = SimpleNamespace(actor=SimpleNamespace(mu=squashed))
    networks = [(squashed, "tanh"), (module("Sequential", hidden, end), "clip")]
    networks += [(SimpleNamespace(policy=p), out) for p, out in ((ppo, "clip"), (sac, "tanh"))]
    networks += [(SimpleNamespace(policy=td3), "tanh")]
    layers = [first, second, last]
    for network, output in networks:
        expected = quadsim.save_pilot(
            layers, tmp_path / "a.npz", vehicle="swift", activation="relu", output=output
        )
        found = quadsim.save_pilot(network, tmp_path / "b.npz", vehicle="swift")
        assert found.digest == expected.digest


@pytest.mark.compiled
@pytest.mark.parametrize("name", ["PPO", "A2C", "SAC", "TD3"])
def test_a_model_of_stable_baselines_is_the_pilot_that_it_is(name, tmp_path):
    library = pytest.importorskip("stable_baselines3")
    from quadsim.learn.stable_baselines import RacingVecEnv

    envs = RacingVecEnv(4, course="figure8", hold=2)
    net = {"net_arch": [16, 8, 8]}
    model = getattr(library, name)("MlpPolicy", envs, device="cpu", policy_kwargs=net)
    pilot = quadsim.save_pilot(model, tmp_path / "p.npz", vehicle="swift", hold=2)
    action, _ = model.predict(SEEN, deterministic=True)
    np.testing.assert_allclose(pilot(SEEN), action, atol=1e-6)


ZEROS = [(np.zeros((SIZE, 4)), np.zeros(4))]
REFUSED = [
    (lambda seen: seen, {}, "controller=quadsim.PolicyController"),
    (None, {}, "policy: expected pairs"),
    ([], {}, "policy: expected 1 to 100 layers, got 0"),
    ([np.zeros((SIZE, 4))], {}, r"layer 1: expected \(matrix, bias\)"),
    ([(np.zeros((3, 4)), np.zeros(4))], {}, r"layer 1: expected a matrix of shape \(38, 4\)"),
    ([(np.zeros((SIZE, 5)), np.zeros(5))], {}, "expected 4 outputs"),
    ([(np.full((SIZE, 4), np.nan), np.zeros(4))], {}, "expected finite numbers"),
    ([("a", "b")], {}, "expected a matrix of 2 dimensions"),
    (ZEROS, {"activation": "gelu"}, "activation: expected one of relu, tanh, identity"),
    ([(np.zeros((SIZE, 4), complex), np.zeros(4))], {}, "expected a matrix of 2 dimensions"),
    ([(np.zeros((SIZE, 4)), None)], {}, "expected a bias of 1 dimension, got None"),
    (ZEROS, {"activation": 3}, "activation: expected one of relu, tanh, identity, got 3"),
    (ZEROS, {"activation": ["tanh"]}, "activation: expected one for each of 0 hidden layers"),
    (ZEROS, {"output": "softmax"}, "output: expected clip or tanh, got 'softmax'"),
    (ZEROS, {"hold": 0}, "hold: expected a whole number"),
    (ZEROS, {"dt": "fast"}, "dt: expected a number"),
    (ZEROS, {"vehicle": "swifd"}, "no vehicle 'swifd'"),
    (ZEROS, {"course": 3}, "course: expected a text"),
    (module("LSTM"), {}, "got LSTM"),
    (module("Sequential", module("Tanh")), {}, "Linear"),
    (module("Sequential", linear(ZEROS[0]), module("ReLU")), {}, "no ReLU behind the last layer"),
    (module("Sequential", linear(ZEROS[0])), {"output": "tanh"}, "output: expected none beside"),
]


@pytest.mark.parametrize(("policy", "settings", "problem"), REFUSED)
def test_what_cannot_be_saved_is_refused_in_one_line(policy, settings, problem, tmp_path):
    path = tmp_path / "p.npz"
    with pytest.raises(ValueError, match=problem) as error:
        quadsim.save_pilot(policy, path, **({"vehicle": "swift"} | settings))
    assert isinstance(error.value, quadsim.SettingError | quadsim.FileError)
    assert "\n" not in str(error.value)
    assert not path.exists()


def test_a_file_with_other_activations_than_layers_is_refused(tmp_path):
    pilot = load_pilot("split_s_swift")
    about = structs.replace(pilot.about, activation=("tanh",))
    (tmp_path / "p.npz").write_bytes(pilot_bytes(pilot.weights, about))
    with pytest.raises(quadsim.FileError, match="one for each of 2 hidden layers, got 1"):
        load_pilot(tmp_path / "p.npz")


def test_a_function_flies_as_the_pilot_that_it_is():
    pilot = load_pilot("split_s_swift")
    maker = quadsim.PolicyController(lambda seen: pilot(seen), hold=pilot.about.hold)
    runs = [
        quadsim.fly("split_s_swift", **part, **FLIGHT)
        for part in ({"pilot": "split_s_swift"}, {"controller": maker})
    ]
    for column in ("px", "pz", "wx_cmd", "a_cmd"):
        np.testing.assert_array_equal(runs[0].telemetry[column], runs[1].telemetry[column])


class Counting:
    """A policy with a memory: the number of its calls."""

    def __init__(self):
        self.calls = 0

    def __call__(self, seen):
        self.calls += 1
        return [0.0, 0.0, 0.0, 0.01 * self.calls - 0.5]


def test_a_class_is_a_policy_that_is_made_anew_for_each_flight():
    maker = quadsim.PolicyController(Counting)
    first, second = (quadsim.fly("figure8", controller=maker, **FLIGHT) for _ in range(2))
    assert first.digest() == second.digest()
    thrust = first.telemetry["a_cmd"]
    assert (np.diff(thrust[:20]) > 0.0).all()


@pytest.mark.parametrize("action", [None, 1.0, [0.0] * 3, [np.nan] * 4, "abcd"])
def test_an_action_that_is_none_ends_the_flight_in_one_line(action):
    maker = quadsim.PolicyController(lambda seen: action)
    with pytest.raises(quadsim.SettingError, match="expected an action of 4 finite numbers"):
        quadsim.fly("figure8", controller=maker, **FLIGHT)


def test_without_stable_baselines_its_environment_says_what_installs_it(monkeypatch):
    pytest.importorskip("gymnasium")
    package = "stable_baselines3"
    for name in (package, *(name for name in sys.modules if name.startswith(f"{package}."))):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, "quadsim.learn.stable_baselines", raising=False)
    with pytest.raises(
        ModuleNotFoundError, match=r"stable-baselines3 is not installed: .*pip install"
    ):
        import_module("quadsim.learn.stable_baselines")


def test_a_policy_controllers_arguments_are_checked():
    for policy, hold, name in ((3, 1, "policy"), (len, 0, "hold"), (len, "x", "hold")):
        with pytest.raises(quadsim.SettingError) as error:
            quadsim.PolicyController(policy, hold)
        assert error.value.name == name
