"""Results as plain data."""

import json

from ddenv.engine.judging import result_data
from ddenv.engine.worker import Broken
from tests.engine.fake import result


def test_what_was_noticed_is_told_to_the_millisecond():
    found = result_data(result("failed", 0, 2.0))
    assert found["first_sensed"] == {"beam": 0.5, "wall": 0.25, "ground_plane": 0.0}
    assert found["first_touched"] == {"beam": 1.5, "ground_plane": 0.0}
    json.dumps(found, allow_nan=False)


def test_a_test_without_a_result_noticed_nothing():
    found = result_data(Broken("timeout", "took too long"))
    assert (found["outcome"], found["first_sensed"], found["first_touched"]) == ("timeout", {}, {})
    assert found["cut"] is False


def test_how_the_robot_failed_and_whether_it_was_cut_are_told():
    found = result_data(result("failed", 0, 2.0, cut=True))
    assert (found["outcome"], found["failure"], found["cut"]) == ("failed", "stuck", True)
