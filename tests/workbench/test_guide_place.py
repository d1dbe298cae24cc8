"""Screens that only watch a run follow the screen that guides it, until they go their own way."""

import fake_moments
import pytest

from ddenv.workbench.run.guide_place import FOLLOWS, OWN_WAY, place_file
from tests.workbench.attached import Attached


async def test_a_watching_screen_follows_the_guiding_one(run):
    fake_moments.finished(run)
    async with Attached(run) as teacher, Attached(run, watch=True) as student:
        await teacher.press("less_than_sign")
        at = teacher.screen.browsing.position.at
        assert at is not None
        await student.look()
        assert student.screen.browsing.position.at == at
        assert student.text("#watching") == FOLLOWS
        await teacher.press("full_stop")
        await student.look()
        assert student.screen.browsing.position.at == teacher.screen.browsing.position.at != at
        await teacher.press("escape")
        await student.look()
        assert student.screen.browsing.position.at is None


async def test_it_goes_its_own_way_until_escape(run):
    fake_moments.finished(run)
    async with Attached(run) as teacher, Attached(run, watch=True) as student:
        await teacher.press("less_than_sign")
        await student.look()
        await student.press("comma", "comma")
        own = student.screen.browsing.position.at
        assert own not in (None, teacher.screen.browsing.position.at)
        assert student.text("#watching") == OWN_WAY
        await teacher.press("comma")
        await student.look()
        assert student.screen.browsing.position.at == own
        await student.press("escape")
        await student.look()
        assert student.screen.browsing.position.at == teacher.screen.browsing.position.at
        assert student.text("#watching") == FOLLOWS


async def test_nobody_follows_a_screen_that_is_gone(run):
    fake_moments.finished(run)
    async with Attached(run) as teacher:
        await teacher.press("less_than_sign")
        assert place_file(run.path).exists()
    assert not place_file(run.path).exists()
    async with Attached(run, watch=True) as student:
        await student.look()
        assert student.screen.browsing.position.at is None


@pytest.mark.parametrize("content", ["", "{", "true", "[1]", "-5", '"x"', "99999999999", "1e300", "9" * 500])
async def test_a_damaged_place_is_no_place(run, content):
    fake_moments.finished(run)
    place_file(run.path).write_text(content)
    async with Attached(run, watch=True) as student:
        await student.look()
        assert student.screen.browsing.position.at is None


async def test_where_nothing_can_be_written_the_guiding_screen_goes_on(run):
    fake_moments.finished(run)
    place_file(run.path).mkdir()
    async with Attached(run) as teacher:
        await teacher.press("less_than_sign")
        assert teacher.screen.browsing.is_past
