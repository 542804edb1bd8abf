from pathlib import Path

import pytest

import dashboards
import flows
import planners
import storage
import tasks

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("package", [dashboards, flows, planners, storage, tasks])
def test_each_package_is_the_one_in_this_checkout(package):
    assert Path(package.__file__).is_relative_to(ROOT)
