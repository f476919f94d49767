"""A record names every number that a flight is made from, whether or not it is at its default."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass, make_dataclass
from typing import Any

import pytest

from quadsim.config.settings import FlightNumbers, HostSettings
from quadsim.config.spec import Spec
from quadsim.controllers.samplers import SAMPLERS, Colored
from quadsim.files.plain_values import plain
from quadsim.racing.events import Event
from quadsim.report.preset_changes import preset_changes
from quadsim.sensing import load_sensing, sensing_names
from quadsim.vehicle import vehicle_names


def missing(part: object, record: Any, place: str = "") -> Iterator[str]:
    """Yield the places of the fields of a part that its record does not have."""
    if is_dataclass(part) and isinstance(record, dict):
        for field in fields(part):
            name = field.name
            if name not in record:
                yield f"{place}{name}"
            else:
                yield from missing(getattr(part, name), record[name], f"{place}{name}.")


def test_a_sampler_without_the_cut_off_of_its_preset_is_recorded_so():
    usual = Spec.of("figure8").planner.sampling
    without = Colored(usual.sigma, usual.gamma)
    assert without != usual
    record = Spec.of("figure8", sampler=without).record()
    assert record["planner"]["sampling"]["cutoff"] != list(usual.cutoff)
    assert "cutoff" in preset_changes(record)


@pytest.mark.parametrize("name", vehicle_names())
def test_a_record_has_all_numbers_of_its_vehicle_planner_and_model(name):
    spec = Spec.of("figure8", vehicle=name)
    record = spec.record()
    assert not list(missing(spec.vehicle, record["vehicle"]))
    assert not list(missing(spec.planner.mppi, record["planner"]["mppi"]))
    assert not list(missing(spec.planner.cost, record["planner"]["cost"]))
    assert not list(missing(spec.model, record["model"]))
    assert not list(missing(spec.variation, record["variation"]))
    assert not list(missing(spec.randomization, record["randomization"]))


@pytest.mark.parametrize("name", sensing_names())
def test_a_record_has_all_numbers_of_its_sensors(name):
    sensing = load_sensing(name)
    assert not list(missing(sensing, plain(sensing)))
    if not sensing.exact:
        assert Spec.of("figure8", sensing=sensing).record()["sensing"] == plain(sensing)


@pytest.mark.parametrize("name", SAMPLERS)
def test_a_record_has_all_numbers_of_its_sampler(name):
    spec = Spec.of("figure8", sampler=name)
    assert not list(missing(spec.planner.sampling, spec.record()["planner"]["sampling"]))


def test_a_record_has_every_setting_that_a_spec_holds():
    record = Spec.of("figure8").record()
    assert {field.name for field in fields(FlightNumbers)} <= record.keys()
    assert {field.name for field in fields(HostSettings)} <= record["host"].keys()


def test_an_event_has_the_same_keys_whatever_it_tells():
    event = Event(1.0, "pass", 1, 1, (0.0, 0.0), 5.0, (0.0, 0.0, 1.0))
    assert event.record().keys() == {field.name for field in fields(Event)}


def test_a_field_that_a_class_is_given_later_is_recorded_without_being_listed():
    """The negative control: the laws above would see one that is left out."""
    later = make_dataclass("Later", [("added", float, 0.0)], bases=(Colored,), frozen=True)
    one = later((1.0,) * 4, (1.0,) * 4)
    assert not list(missing(one, plain(one)))
    known = {field.name: 0.0 for field in fields(Colored)}
    assert list(missing(one, known)) == ["added"]
