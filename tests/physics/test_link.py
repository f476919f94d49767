"""The link: its rate, its latency, its losses, and what the planner is told of them."""

import numpy as np
import pytest
from numpy.random import SeedSequence

import quadsim
from quadsim.dynamics.quadrotor import Control
from quadsim.files.values import SettingError
from quadsim.physics.link import HOVER, Link, LinkConfig
from quadsim.sensing.estimation.prediction import Commands
from quadsim.vehicle import GRAVITY
from tests.small import SHORT

DT = 1e-3
FLIGHT = {**SHORT, "plant": "rigid", "link_hz": 100}


def command(thrust):
    return Control(0.0, 0.0, 0.0, thrust)


def carried(link, thrusts):
    """Return what the receiver has after each step, and in which steps a frame has arrived."""
    received = [link.carry(command(thrust)) for thrust in thrusts]
    return [r.command.thrust for r in received], [k for k, r in enumerate(received) if r.is_new]


def test_a_wire_passes_each_command_on_at_once():
    thrusts, frames = carried(Link(DT), range(5))
    assert thrusts == [0, 1, 2, 3, 4]
    assert frames == [0, 1, 2, 3, 4]


def test_the_latencies_of_link_and_vehicle_add_up():
    link = Link(DT, vehicle_latency=2e-3, config=LinkConfig(latency=1e-3))
    thrusts, frames = carried(link, range(6))
    assert thrusts == [GRAVITY] * 3 + [0, 1, 2]
    assert frames == [3, 4, 5]


@pytest.mark.parametrize(("rate", "steps"), [(40.0, 25), (100.0, 10), (250.0, 4), (1000.0, 1)])
def test_frames_come_at_their_rate_and_the_receiver_keeps_the_last(rate, steps):
    thrusts, frames = carried(Link(DT, config=LinkConfig(rate=rate)), range(101))
    assert frames == list(range(0, 101, steps))
    assert thrusts == [k - k % steps for k in range(101)]


def test_a_rate_that_is_no_share_of_the_step_is_kept_in_the_mean():
    _, frames = carried(Link(DT, config=LinkConfig(rate=150.0)), [0.0] * 2000)
    assert len(frames) == 300
    assert set(np.diff(frames)) == {6, 7}


def test_a_command_is_reached_along_a_line_within_a_control_period():
    link = Link(DT, interpolation=0.01)
    thrusts, _ = carried(link, [GRAVITY + 10.0] * 12)
    line = GRAVITY + np.arange(1, 11)
    np.testing.assert_allclose(thrusts, [*line, *[GRAVITY + 10.0] * 2], rtol=1e-12)


def test_a_frame_for_each_control_period_carries_the_command_itself():
    link = Link(DT, config=LinkConfig(rate=100.0), interpolation=0.01)
    thrusts, _ = carried(link, [20.0] * 10 + [30.0] * 10)
    assert thrusts == [20.0] * 10 + [30.0] * 10


def burst_lengths(frames, count):
    """Return how many frames in a row are lost, for each burst."""
    gaps = np.diff([-1, *frames, count]) - 1
    return gaps[gaps > 0]


@pytest.mark.slow
@pytest.mark.parametrize(("loss", "burst"), [(0.2, None), (0.2, 5.0), (0.05, 2.0), (0.5, 4.0)])
def test_losses_have_their_share_and_their_bursts_their_mean_length(loss, burst):
    count = 40_000
    config = LinkConfig(loss=loss, burst=burst)
    _, frames = carried(Link(DT, config=config, stream=SeedSequence(3)), [0.0] * count)
    lengths = burst_lengths(frames, count)
    wanted = burst or 1.0 / (1.0 - loss)
    # Of the share, bursts are what is independent: its standard deviation grows with their length.
    std = np.sqrt(2.0 * wanted * loss * (1.0 - loss) / count)
    assert 1.0 - len(frames) / count == pytest.approx(loss, abs=4.0 * std)
    # A geometric distribution has a standard deviation of about its mean.
    assert lengths.mean() == pytest.approx(wanted, abs=4.0 * wanted / np.sqrt(len(lengths)))


def test_bursts_are_not_independent_losses():
    """A negative control of the test above: the same share in bursts fails its length."""
    count = 20_000
    config = LinkConfig(loss=0.2, burst=5.0)
    _, frames = carried(Link(DT, config=config, stream=SeedSequence(3)), [0.0] * count)
    lengths = burst_lengths(frames, count)
    independent = 1.0 / 0.8
    assert lengths.mean() > independent + 4.0 * independent / np.sqrt(len(lengths))


def test_the_receiver_has_the_command_of_hovering_until_a_frame_arrives():
    link = Link(DT, config=LinkConfig(loss=0.9, burst=1e4), stream=SeedSequence(0))
    thrusts, frames = carried(link, [25.0] * 20)
    assert frames == []
    assert thrusts == [HOVER.thrust] * 20


@pytest.mark.parametrize("rate", [40.0, 100.0, 125.0, 200.0, 250.0])
def test_the_planner_knows_which_command_acts_when(rate):
    """The commands as they are predicted are those that the link passes on."""
    config = LinkConfig(rate=rate, latency=0.02)
    commands = Commands(tuple(HOVER), config.latency, config.period)
    link = Link(DT, config=config)
    for k in range(300):
        given = command(k - k % 10)
        if k % 10 == 0:
            commands.give(k * DT, given)
        assert link.carry(given).command == commands.acting(k * DT)


@pytest.mark.compiled
def test_each_number_of_a_link_changes_the_flight():
    digests = {
        quadsim.fly("figure8", **FLIGHT | change).digest()
        for change in ({}, {"link_hz": 40}, {"link_latency": 0.03}, {"link_loss": 0.3})
    }
    assert len(digests) == 4


@pytest.mark.compiled
def test_a_flight_over_a_link_is_flown_again_from_its_record():
    settings = {"link_hz": 50.0, "link_latency": 0.02, "link_loss": 0.2, "link_burst": 3.0}
    run = quadsim.fly("figure8", **FLIGHT | settings)
    assert {name: run.spec[name] for name in settings} == settings
    assert quadsim.fly(run.spec).digest() == run.digest()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"link_hz": 1000}, "link_hz: expected at most 400 Hz, a frame in each physics step"),
        ({"link_burst": 2}, "link_burst: expected none without link_loss, got 2"),
        (
            {"link_loss": 0.8, "link_burst": 2},
            "link_burst: expected at least 4 frames with link_loss, got 2",
        ),
        (
            {"link_latency": 0.02, "plant": "rotorpy"},
            "link_latency: expected plant bullet or rigid for a link, got rotorpy",
        ),
        ({"link_loss": 1.0}, "link_loss: expected"),
    ],
)
def test_a_link_that_cannot_be_is_one_line(settings, said):
    with pytest.raises(SettingError) as caught:
        quadsim.Spec.of("figure8", **settings)
    assert str(caught.value).startswith(said)
    assert "\n" not in str(caught.value)
