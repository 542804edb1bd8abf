"""Vehicles from files: each is what its file says, and what is wrong in a file is told in one line."""

from __future__ import annotations

import copy
import json
import re
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from planners.world.vehicles.vehicle import CAR, CAR_2_TRAILERS, DIFFERENTIAL_DRIVE, VEHICLES, Trailer
from storage.errors import StorageError
from storage.vehicles.definitions import definition_of, first_difference, vehicle_of
from storage.vehicles.recorded_vehicle import refuse_another
from storage.vehicles.sizes import check_sizes
from storage.vehicles.vehicle_files import (
    BUILT_IN,
    label_of,
    read_vehicle,
    said_vehicle,
    scale_for_vehicle,
    text_of_vehicle,
)

EXAMPLES = sorted((Path(__file__).parents[3] / "docs" / "vehicles").glob("*.yaml"))
CAR_FILE: dict[str, Any] = yaml.safe_load((BUILT_IN / "car.yaml").read_text())
TRAILER_FILE: dict[str, Any] = yaml.safe_load((BUILT_IN / "car-2-trailers.yaml").read_text())
SMALL = CAR_FILE | {"name": "small", "limits": CAR_FILE["limits"] | {"speed": [-1, 3]}}


def changed(fields: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """A definition in which the field at a path like ``limits.speed`` is another; None leaves it out."""
    fields = copy.deepcopy(fields)
    inner, keys = fields, [int(key) if key.isdigit() else key for key in path.split(".")]
    for key in keys[:-1]:
        inner = inner[key]
    if value is None:
        del inner[keys[-1]]
    else:
        inner[keys[-1]] = value
    return fields


@pytest.mark.parametrize("name", VEHICLES)
def test_the_built_in_vehicles_are_those_of_their_files(name: str) -> None:
    assert read_vehicle(BUILT_IN / f"{name}.yaml") == VEHICLES[name]
    assert text_of_vehicle(name) == name == label_of(said_vehicle(name))


def test_there_are_ten_examples_of_all_kinds() -> None:
    vehicles = [read_vehicle(path) for path in EXAMPLES]
    assert len(vehicles) >= 10
    assert {definition_of(vehicle)["kind"] for vehicle in vehicles} == {
        "car", "car-first-order", "differential-drive", "unicycle-first-order"
    }  # fmt: skip


@pytest.mark.parametrize("path", EXAMPLES, ids=[path.stem for path in EXAMPLES])
def test_a_file_a_vehicle_and_its_text_say_the_same(path: Path) -> None:
    vehicle, fields = read_vehicle(path), yaml.safe_load(path.read_text())
    definition = definition_of(vehicle)
    assert definition["name"] == fields["name"] == path.stem
    assert {name: definition[name] for name in fields if name not in ("body", "trailers")} == {
        name: fields[name] for name in fields if name not in ("body", "trailers")
    }
    corners = [{tuple(map(float, corner)) for corner in polygon} for polygon in fields["body"]]
    assert [set(map(tuple, polygon)) for polygon in definition["body"]] == corners
    assert said_vehicle(text_of_vehicle(str(path))) == vehicle
    assert vehicle_of(json.loads(json.dumps(definition))) == vehicle


@pytest.mark.parametrize("path", EXAMPLES, ids=[path.stem for path in EXAMPLES])
def test_lateral_acceleration_may_be_limited_whatever_the_kind_and_the_scale(path: Path) -> None:
    limits = yaml.safe_load(path.read_text())
    limits["limits"]["lateral_acceleration"] = 1.7
    vehicle = vehicle_of(limits)
    assert vehicle.scale * vehicle.max_lateral_acceleration == pytest.approx(1.7)
    definition = definition_of(vehicle)
    assert definition["limits"]["lateral_acceleration"] == pytest.approx(1.7)
    assert vehicle_of(json.loads(json.dumps(definition))) == vehicle


@pytest.mark.parametrize("path", EXAMPLES, ids=[path.stem for path in EXAMPLES])
def test_a_new_vehicle_brings_no_new_type_of_values(path: Path) -> None:
    """So that nothing is compiled for it: Numba compiles for types, and settings are values."""
    vehicle = read_vehicle(path)
    usual = {type(each): each for each in (CAR, DIFFERENTIAL_DRIVE, CAR_2_TRAILERS)}[type(vehicle)]
    for value, other in zip(vehicle, usual, strict=True):
        assert type(value) is type(other)
    for trailer in getattr(vehicle, "trailers", ()):
        assert [type(value) for value in trailer] == [type(value) for value in CAR_2_TRAILERS.trailers[0]]


@pytest.mark.parametrize(
    ("path", "value", "told"),
    [
        ("name", "Two Words", "name"),
        ("kind", "tram", "kind 'tram'; known are car,"),
        ("kind", "car-first-order", "limit acceleration, which the kind car-first-order does not have"),
        ("kind", "unicycle-first-order", "wheelbase"),
        ("wheelbase", None, "lacks the field wheelbase"),
        ("wheelbase", -1.6, "wheelbase -1.6 m; expected 0.001 to 100"),
        ("wheelbase", 1e-320, "wheelbase"),
        ("limits.acceleration", 1e-9, "limits.acceleration"),
        ("limits.steering_rate", 1e-320, "limits.steering_rate"),
        ("wheelbase", "long", "'long' as its wheelbase, expected a number"),
        ("wheelbase", True, "'True' as its wheelbase"),
        ("weelbase", 1.6, "unknown field 'weelbase' (nearest is 'wheelbase')"),
        ("step", 0.5, "step of 0.5 s, in which a point of the vehicle moves up to 2 m"),
        ("step", float("nan"), "step nan s"),
        ("limits", 3, "limits 3"),
        ("limits.speed", 4, "[least, most] in m/s"),
        ("limits.speed", [4, -1], "limits.speed [4, -1] m/s"),
        ("limits.speed", [-4, 0], "limits.speed [-4, 0] m/s"),
        ("limits.steering", 40, "limits.steering 40 rad; expected 0.001 to 1.4"),
        ("limits.steering", None, "lacks the field limits.steering"),
        ("limits.stering", 0.5, "nearest is 'limits.steering'"),
        ("limits.lateral_acceleration", 0, "limits.lateral_acceleration 0 m/s^2; expected 0.001 to 100"),
        ("limits", CAR_FILE["limits"] | {"lateral_acceleration": None}, "limits.lateral_acceleration"),
        ("limits.lateral_aceleration", 2, "nearest is 'limits.lateral_acceleration'"),
        ("limits.lateral", 2, "nearest is 'limits.lateral_acceleration'"),
        ("limits.turn_rate", 0.5, "limit turn_rate, which the kind car does not have"),
        ("body", [], "body []; expected a list of 1 to 16"),
        ("body", [[[0, 0], [1, 0]]], "3 to 32 corners"),
        ("body", [[[0, 0], [1, 0], [1, "a"]]], "'a' as its body polygon 1 corner"),
        ("body", [[[-1, -1], [1, -1], [0, 0], [1, 1], [-1, 1]]], "body polygon 1, which is not convex"),
        ("body", [[[1, -1], [2, -1], [2, 1], [1, 1]]], "does not surround the reference point"),
        ("body", [[[-1, -1], [-1, -1], [2, 1], [1, 1]]], "two corners of body polygon 1 at the same place"),
        ("body", [[[-900, -1], [900, -1], [2, 1]]], "in metres?"),
        ("trailers", [], "list of 1 to 3"),
        ("trailers", [{"hitch_length": 1.9, "max_hitch": 1}], "lacks the field trailer 1 body"),
        ("trailers", [{"hitch_offset": 1.9}], "the unknown field trailer 1 'hitch_offset'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_its_field(tmp_path: Path, path: str, value: Any, told: str) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(changed(CAR_FILE | {"name": "mine"}, path, value)))
    with pytest.raises(StorageError) as caught:
        read_vehicle(file)
    assert told in str(caught.value)
    assert str(caught.value).startswith(str(file))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("name: a\nname: b\n", "more than once"),
        ("limits: {speed: [0, 1], speed: [0, 2]}\n", "more than once"),
        ("a: &a [1, 1]\nb: *a\n", "alias"),
        ("!!python/object/apply:os.getcwd []\n", "is not YAML"),
        ("[" * 3_000, "more brackets than any vehicle"),
        ("- car\n", "is not the YAML of a vehicle"),
        ("name: car\n", "kind"),
    ],
)
def test_what_is_no_plain_yaml_is_refused(tmp_path: Path, text: str, told: str) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(StorageError, match=told):
        read_vehicle(file)


def test_trailers_that_would_meet_the_body_in_front_are_refused() -> None:
    with pytest.raises(ValueError, match=r"trailer 2 .* hitch angle"):
        vehicle_of(changed(TRAILER_FILE, "trailers.1.hitch_length", 1.75))


def test_another_vehicle_cannot_have_the_name_of_a_built_in_one(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(changed(CAR_FILE, "limits.acceleration", 3)))
    with pytest.raises(StorageError, match="name of another vehicle, 'car'"):
        read_vehicle(file)


def test_an_unknown_vehicle_is_refused_with_the_nearest() -> None:
    with pytest.raises(StorageError, match=r"Unknown vehicle 'cat' \(nearest is 'car'\)"):
        text_of_vehicle("cat")
    with pytest.raises(StorageError, match=r"none\.yaml does not exist"):
        text_of_vehicle("none.yaml")


VALUES = st.one_of(
    st.none(), st.booleans(), st.floats(), st.integers(-9, 9), st.text(max_size=3),
    st.lists(st.floats(-3, 3), max_size=3), st.lists(st.lists(st.floats(-2, 2), max_size=2), max_size=4),
)  # fmt: skip


@settings(max_examples=300, deadline=None)
@given(st.dictionaries(st.sampled_from([*TRAILER_FILE, "stp"]), VALUES, min_size=1, max_size=3))
def test_whatever_is_written_is_a_vehicle_or_an_error_of_one_line(values: dict[str, Any]) -> None:
    told = ""
    try:
        vehicle_of(TRAILER_FILE | {"name": "mine"} | values)
    except ValueError as error:
        told = str(error)
    assert "\n" not in told


def test_what_drives_cost_is_read_and_told_again_and_what_is_made_for_other_costs_fits() -> None:
    costs = {"gear_change": 1.5, "forwards": 1, "backwards": 2}
    dear = vehicle_of(SMALL | {"costs": costs})
    assert dear.costs == (1.5, 1.0, 2.0)
    assert definition_of(dear)["costs"] == {"gear_change": 1.5, "backwards": 2.0}
    assert vehicle_of(definition_of(dear)) == dear
    cheap = vehicle_of(SMALL | {"costs": {}})
    assert "costs" not in definition_of(cheap)
    refuse_another("archive", definition_of(dear), cheap)
    refuse_another("archive", definition_of(cheap), dear)


@pytest.mark.parametrize(
    ("costs", "told"),
    [
        (2, "has costs 2; expected fields gear_change, forwards, backwards"),
        ({"backward": 2}, "unknown field 'costs.backward'"),
        ({"backwards": 0.5}, "has costs.backwards 0.5; expected 1 to 100"),
        ({"gear_change": -1}, "has costs.gear_change -1.0; expected 0 to 100"),
        ({"gear_change": "much"}, "costs.gear_change"),
        ({"forwards": float("nan")}, "costs.forwards"),
        ({"gear_change": None}, "costs.gear_change"),
    ],
)
def test_costs_that_make_no_sense_are_refused_by_name(costs: Any, told: str) -> None:
    with pytest.raises(ValueError, match=re.escape(told)):
        vehicle_of(SMALL | {"costs": costs})


def test_a_difference_is_told_by_its_field_and_the_name_is_none() -> None:
    assert first_difference(SMALL, SMALL | {"name": "other"}) == ""
    longer = changed(TRAILER_FILE, "trailers.1.max_hitch", 0.9)
    assert first_difference(TRAILER_FILE, longer) == "trailers.2.max_hitch is 1 there and 0.9 here"
    assert first_difference(SMALL, CAR_FILE) == "limits.speed is [-1, 3] there and [-1, 4] here"


def test_what_was_made_for_another_vehicle_is_refused_with_the_first_difference() -> None:
    small, renamed = vehicle_of(SMALL), vehicle_of(SMALL | {"name": "renamed"})
    refuse_another("archive", definition_of(small), renamed)
    with pytest.raises(StorageError, match=r"for vehicle small, expected car: limits\.speed is \[-1"):
        refuse_another("archive", definition_of(small), CAR)
    with pytest.raises(StorageError, match="--vehicle car"):
        refuse_another("archive", definition_of(CAR), small)
    for nothing in (None, "tram", {"front": 3.0}, [1]):
        with pytest.raises(StorageError, match="no such vehicle"):
            refuse_another("archive", nothing, CAR)


def test_what_earlier_versions_recorded_of_the_built_in_vehicles_is_understood() -> None:
    recorded = {
        "front": 1.8, "rear": 0.2, "width": 0.9, "wheelbase": 1.6, "max_steering": 0.6981317007977318,
        "min_speed": -1.0, "max_speed": 4.0, "max_acceleration": 2.0, "max_steering_rate": 1.6, "dt": 0.1,
    }  # fmt: skip
    refuse_another("archive", recorded, CAR)
    trailers = {
        "hitch_lengths": [1.9, 1.9], "trailer_front": 1.2, "trailer_rear": 0.5, "trailer_width": 0.8,
        "max_hitch": 1.0,
    }  # fmt: skip
    refuse_another("archive", recorded | trailers, CAR_2_TRAILERS)
    with pytest.raises(StorageError, match="expected car-2-trailers: trailers is given only here"):
        refuse_another("archive", recorded, CAR_2_TRAILERS)


def test_a_vehicle_with_a_file_has_its_own_scale() -> None:
    big = vehicle_of(SMALL | {"body": [[[-1, -1], [4, -1], [4, 1], [-1, 1]]]})
    assert scale_for_vehicle(None, big) == big.scale == 4.0
    assert scale_for_vehicle(None, CAR) == 1.0
    assert scale_for_vehicle(2.0, CAR) == 2.0
    with pytest.raises(ValueError, match="scale is 2, but the scale of small is 4"):
        scale_for_vehicle(2.0, big)


@pytest.mark.parametrize(("fold", "meets"), [(1.57, True), (0.6, False)])
def test_bodies_that_are_not_neighbours_must_not_meet_either(fold: float, meets: bool) -> None:
    """The second trailer swings round a short first one into the side of the car."""
    body = Trailer(0.8, 0.1, 0.3, 0.6, fold), Trailer(1.0, 0.3, 0.5, 1.0, fold)
    vehicle = CAR_2_TRAILERS._replace(front=1.5, rear=0.2, width=1.0, trailers=body)
    with pytest.raises(ValueError, match="trailer 2 that touch each other") if meets else nullcontext():
        check_sizes(vehicle)
