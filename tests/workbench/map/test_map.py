"""The map with its keys and the mouse, on a screen of its own."""

from dataclasses import replace

import fake_moments
import fake_run
import numpy as np
import pytest
from textual import on
from textual.app import App
from textual.containers import Vertical
from textual.events import MouseScrollUp

from ddenv.environment import Environment
from ddenv.map.footprints import Footprint
from ddenv.runfile.fold import fold
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.store import Live, RunFile
from ddenv.runs.experiment import read_parts
from ddenv.workbench.map.map_words import legend
from ddenv.workbench.map.place import LAYERS, Place, Way, place_of_run
from ddenv.workbench.map.world_map import WorldMap
from ddenv.workbench.shared.poll import Poll


class Screen(App):
    """A map in a panel, and what it posts."""

    CSS = "WorldMap { height: 1fr; } Vertical { border: round white; }"

    def __init__(self) -> None:
        super().__init__()
        self.pointed, self.selections, self.places = [], [], []

    def compose(self):
        with Vertical():
            yield WorldMap(id="map")

    @on(WorldMap.Pointed)
    def keep_pointed(self, event):
        self.pointed.append(event.model)

    @on(WorldMap.SelectionChanged)
    def keep_selection(self, event):
        self.selections.append(set(event.models))

    @on(WorldMap.PlacePicked)
    def keep_place(self, event):
        self.places.append((event.x, event.y))


class Shown:
    """A map of a run on a screen of 62 x 22: `async with Shown(run) as (pilot, world)`."""

    def __init__(self, run=None, size=(62, 22)) -> None:
        self.run, self.size = run, size

    async def __aenter__(self):
        self._test = Screen().run_test(size=self.size)
        pilot = await self._test.__aenter__()
        world = pilot.app.query_one(WorldMap)
        world.focus()
        if self.run is not None:
            self.poll = Poll(self.run.path)
            world.set_place(place_of_run(self.run.path))
            world.show(self.poll.look(), None)
        await pilot.pause()
        return pilot, world

    async def __aexit__(self, *error):
        if self.run is not None:
            self.poll.close()
        await self._test.__aexit__(*error)


def text_of(world) -> str:
    return "\n".join(world.render_line(row).text for row in range(world.size.height))


def subtitle(world) -> str:
    return str(world.parent.border_subtitle)


@pytest.fixture
def busy(run):
    fake_moments.mid_round(run).hold()
    return run


async def test_brackets_go_through_the_models_that_are_kept(busy):
    async with Shown(busy) as (pilot, world):
        world.go_to("crate_05")
        await pilot.press("]")
        assert world.model_at_cursor == "crate_00"
        await pilot.press("]", "]", "[")
        await pilot.pause()
        assert world.model_at_cursor == "crate_01"
        assert pilot.app.pointed[-1] == "crate_01"
        assert "part A" in subtitle(world)
        # The crosshair finds removed models on a floor.
        world.go_to("crate_10")
        await pilot.press("right")
        assert world.model_at_cursor == "crate_10"
        world.toggle_layer("removed")
        assert world.model_at_cursor == "floor"


async def test_enter_selects_the_model_under_the_crosshair_and_again_no_longer(busy):
    async with Shown(busy) as (pilot, world):
        world.go_to("crate_03")
        await pilot.press("enter")
        world.go_to("crate_02")
        await pilot.press("enter")
        assert world.selection == {"crate_02", "crate_03"}
        assert "*B" in text_of(world)
        assert "* selected" in legend(world.shown, 80).plain
        await pilot.press("enter")
        assert pilot.app.selections[-1] == {"crate_03"}
        world.select(())
        assert world.selection == frozenset()
        # Removed models are selected no longer.
        world.select(["crate_00", "crate_04"])
        state = world.snapshot.state
        left = tuple(name for name in state.environment if name != "crate_04")
        world.show(Snapshot(state=state.changed(environment=left)), None)
        await pilot.pause()
        assert pilot.app.selections[-1] == world.selection == {"crate_00"}


@pytest.mark.parametrize("name", ["floor", "crate_10"])
async def test_what_cannot_be_left_out_is_not_selected(busy, name):
    async with Shown(busy) as (pilot, world):
        assert world.go_to(name)
        await pilot.press("enter")
        await pilot.pause()
        assert world.selection == frozenset()
        assert len(pilot.app._notifications) == 1


async def test_the_crosshair_moves_by_cells_and_pans_at_the_border(busy):
    async with Shown(busy) as (pilot, world):
        view, (row, column) = world.viewport.view, world.viewport.cursor
        await pilot.press("left", "up")
        assert world.viewport.cursor == (row - 1, column - 1)
        assert world.viewport.view == view
        await pilot.press(*["up"] * (row + 2))
        assert world.viewport.cursor[0] == 0
        assert world.viewport.view.y == pytest.approx(view.y + 3 * 2 * view.scale)
        await pilot.press("shift+right")
        assert world.viewport.view.x > view.x
        assert world.viewport.cursor == (0, column - 1)
        assert "┼" in text_of(world)


async def test_the_crosshair_keeps_its_place_in_the_world_where_the_map_changes_its_size(busy):
    async with Shown(busy) as (pilot, world):
        await pilot.press(*["left"] * 4, *["up"] * 2)
        before, port = world.viewport.view, world.viewport
        x, y = before.point(port.cursor)
        await pilot.resize_terminal(64, 20)
        await pilot.pause()
        assert port.view != before
        assert port.view.cell(x, y) == port.cursor


async def test_a_model_outside_the_view_comes_into_it(busy):
    async with Shown(busy) as (pilot, world):
        world.zoom(8)
        world.viewport.pan(500, 0)
        await pilot.pause()
        assert world.go_to("crate_02")
        assert world.model_at_cursor == "crate_02"
        assert (
            world.viewport.view.cell(*world.place.prints[world._numbers["crate_02"]].center)
            == world.viewport.cursor
        )
        assert not world.go_to("nothing")


async def test_a_click_selects_a_drag_pans_and_the_wheel_keeps_the_place_under_the_pointer(busy):
    async with Shown(busy) as (pilot, world):
        index = world._numbers["crate_01"]
        row, column = world.picture.cells[index]
        await pilot.click(world, offset=(column, row))
        assert world.selection == {"crate_01"}
        view = world.viewport.view
        await pilot.mouse_down(world, offset=(10, 5))
        await pilot.hover(world, offset=(14, 7))
        await pilot.mouse_up(world, offset=(14, 7))
        assert world.selection == {"crate_01"}
        assert world.viewport.view.x == pytest.approx(view.x - 4 * view.scale)
        assert world.viewport.view.y == pytest.approx(view.y + 2 * 2 * view.scale)
        before = world.viewport.view.point((3, 10))
        world.post_message(
            MouseScrollUp(world, 10, 3, 0, 0, 0, False, False, False, screen_x=11, screen_y=4)
        )
        await pilot.pause()
        assert world.viewport.view.scale < view.scale
        assert world.viewport.view.point((3, 10)) == pytest.approx(before)


async def test_a_place_is_picked_by_enter_or_click(busy):
    async with Shown(busy) as (pilot, world):
        world.picking = True
        await pilot.press("right", "enter")
        x, y = world.viewport.view.point(world.viewport.cursor)
        assert subtitle(world) == f"x {x:.2f}, y {y:.2f} m"
        await pilot.click(world, offset=(10, 5))
        assert pilot.app.places == [
            pytest.approx((x, y), abs=1e-3),
            pytest.approx(world.viewport.view.point((5, 10)), abs=1e-3),
        ]
        assert world.selection == frozenset()


SIGNS = {
    "removed": "·",
    "pinned": "+",
    "path": "⠒",
    "failure": "×",
    "sensed": "A3",
    "participants": "b",
}
HIDDEN = ("sensed", "participants")


@pytest.mark.parametrize("layer", SIGNS)
async def test_layers_are_shown_or_not(run, layer):
    fake_moments.mid_round(run).write("pinned", models=[1])
    test = fold(run.file.events()).evidence_test
    async with Shown(run) as (pilot, world):
        state = world.snapshot.state
        sensed = tuple((f"crate_{number:02}", 5.0 - number) for number in range(3))
        tests = [
            each if each.id != test else fake_sensed(state, each, sensed) for each in state.tests
        ]
        world.show(
            Snapshot(
                state=state.changed(tests=type(state.tests).of(tests)),
                live=(),
                engine="absent",
                evidence=world.snapshot.evidence,
            ),
            None,
        )
        pilot.app.set_focus(None)
        await pilot.pause()
        seen = []
        for _ in range(2):
            text = text_of(world)
            seen.append(
                SIGNS[layer] in text
                or (layer == "path" and any("⠀" < char <= "⣿" for char in text))
            )
            world.toggle_layer(layer)
        assert seen == [layer not in HIDDEN, layer in HIDDEN]
        world.toggle_layer("partitions")
        assert "A B" not in legend(world.shown, 200).plain
        assert layer in LAYERS


async def test_names_stand_beside_their_models_and_do_not_overlap(run):
    fake_moments.mid_round(run)
    async with Shown(run, (120, 36)) as (_, world):
        assert "crate" not in text_of(world)
        world.toggle_layer("names")
        left = world.snapshot.state.environment
        named = [name for name in left if name in text_of(world)]
        # The first ones are those near f; a name that is there is whole.
        assert len(named) >= len(left) // 2
        assert text_of(world).count("crate_") == len(named)


def fake_sensed(state, test, sensed):
    met = Environment.of(state.elements.index(name) for name, _ in sensed)
    return replace(test, first_sensed=sensed, took_part=met)


async def test_the_legend_begins_with_the_places_and_has_the_letters_once_there_are_parts(run):
    run.created()
    async with Shown(run) as (_, world):
        assert legend(world.shown, 200).plain.startswith("S start  G goal  × end of f")
        assert "parts" not in legend(world.shown, 200).plain
    fake_moments.mid_round(run)
    async with Shown(run) as (_, world):
        assert legend(world.shown, 25, 1).plain == "S start G goal × end of f"
        assert legend(world.shown, 30, 1).plain == "S start  G goal  × end of f"
        assert legend(world.shown, 30, 2).plain.splitlines()[1].startswith("A B parts  ")
        assert max(map(len, legend(world.shown, 30, 2).plain.splitlines())) <= 30


async def test_the_original_path_is_dashed_beside_the_last_similar_one(busy):
    async with Shown(busy) as (_, world):
        before = world.picture.canvas.chars.copy()
        moved = type(world.snapshot.evidence)("d", world.snapshot.evidence)
        for index in range(2, len(moved), 8):
            moved[index] -= 2.0
        world.show(
            Snapshot(state=world.snapshot.state, evidence=world.snapshot.evidence, original=moved),
            None,
        )
        new = world.picture.canvas.chars[(world.picture.canvas.chars != before)]
        assert (new > 0x2800).any()
        assert "path of f" in legend(world.shown, 100).plain
        world.toggle_layer("original")
        assert (world.picture.canvas.chars == before).all()


async def test_only_the_rows_of_the_robot_are_drawn_when_only_it_moves(busy, monkeypatch):
    async with Shown(busy) as (_, world):
        regions = []
        monkeypatch.setattr(world, "refresh", lambda *changed, **_: regions.extend(changed))
        snapshot = world.snapshot
        first, second = snapshot.live
        x, y, *rest = first.pose
        moved = Live(
            slot=first.slot, test=first.test, time=first.time + 0.1, pose=(x + 0.3, y, *rest)
        )
        world.show(replace(snapshot, live=(moved, second)), None)
        assert 1 <= len(regions) <= 2


async def test_a_model_that_a_running_test_moves_moves_on_the_map(busy):
    async with Shown(busy) as (_, world):
        name, snapshot = "crate_00", world.snapshot
        with RunFile(busy.path) as file:
            crate = read_parts(file)[1].model(name)
        place = replace(world.place, movable={name: crate})
        world.set_place(place)
        (first, *others), (x, y, z) = snapshot.live, crate.links[0].pose.position

        def at(models):
            world.show(replace(snapshot, live=(replace(first, models=models), *others)), None)
            return world.picture.cells.get(
                [each.name for each in place.prints].index(name)
            ), text_of(world)

        still = at({})
        moved = at({name: (x + 3.0, y, z, 1.0, 0.0, 0.0, 0.0), "unknown": (0.0,) * 7})
        assert moved[0][1] > still[0][1] and moved[1] != still[1]
        # The next test begins, and it is back.
        assert at({}) == still


async def test_words_about_a_model(busy):
    async with Shown(busy) as (_, world):
        assert world.describe("crate_00").plain == "crate_00 · part A · 1.2 x 0.8 m · 5.9 m from f"
        assert world.describe("crate_00", 24).plain == "crate_00 · part A · 1.2…"
        assert "removed" in world.describe("crate_10").plain
        assert "protected" in world.describe("floor").plain
        assert world.describe("nothing").plain == ""


async def test_strange_names_are_one_harmless_line(runs):
    name = "[red]\u202e\u05d0\u05d1" + "x" * 300
    run = (
        fake_run.FakeRun(runs / "x.ddenv", world=fake_run.world_text([name, "other"]))
        .created()
        .baseline()
    )
    async with Shown(run) as (pilot, world):
        world.go_to(run.elements[0])
        await pilot.pause()
        assert len(world.describe(run.elements[0]).plain) < 90
        assert len(world.describe(run.elements[0], 20).plain) == 20
        assert "\u202e" not in subtitle(world)
        assert "[red]" in world.describe(run.elements[0]).plain
    run.close()


@pytest.mark.parametrize("count", [0, 1])
async def test_worlds_of_few_models(count):
    prints = tuple(Footprint(f"m{number}", (), (1.0, 1.0), (1.0, 1.0)) for number in range(count))
    async with Shown() as (pilot, world):
        world.set_place(
            Place(
                prints=prints,
                spawn=(0.0, 0.0, 0.0),
                goal=(3.0, 0.0),
                elements=frozenset(each.name for each in prints),
            )
        )
        await pilot.press("]", "enter", "up", "plus")
        text = text_of(world)
        assert "S" in text
        assert "G" in text
        assert world.selection == frozenset()
        if not count:
            assert subtitle(world) == "this world has no models"


@pytest.mark.parametrize("reach", [10, 200])
async def test_two_ways_fill_the_map_of_a_large_world(reach):
    prints = tuple(
        Footprint(f"m{x}", (), (x, 0.0), (x + 1.0, 1.0)) for x in range(-reach, reach, 5)
    )
    ways = tuple(
        Way(name, np.linspace((0, 0), (6, y), 20)) for name, y in (("with", 0.5), ("without", -0.5))
    )
    async with Shown() as (pilot, world):
        world.set_place(
            Place(
                prints=prints,
                spawn=(0.0, 0.0, 0.0),
                goal=(6.0, 0.0),
                elements=frozenset(each.name for each in prints),
            )
        )
        world.show_ways(ways, None, None, world.place.prints)
        await pilot.pause()
        view = world.viewport.view
        shown = sum(view.cell(*each.center) is not None for each in prints)
        assert (shown == len(prints)) == (reach == 10)
        assert all(view.cell(x, y) is not None for x in (0, 6) for y in (0.5, -0.5))
        assert view.cell(6, 0)[1] - view.cell(0, 0)[1] > (30 if reach == 200 else 10)
