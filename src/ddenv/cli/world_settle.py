"""Lets a world come to rest, and writes it with the poses of its models then."""

from __future__ import annotations

from pathlib import Path

from ddenv.cli.options import announce, announced
from ddenv.errors import UserError
from ddenv.words import count, first_of
from ddenv.world.model import World
from ddenv.world.scenario import Reading

# A line names so many models.
MOST_NAMES = 5


def settle_world(world: World, reading: Reading, output: Path) -> list[str]:
    """Writes the settled `world`, which was read as `reading` says; returns what to say of it. Raises UserError."""
    from ddenv.robot import check_drake

    check_drake()
    from ddenv.robot.settled import moved, notes_on
    from ddenv.robot.simulation.template import Variants
    from ddenv.runs.scenarios import scenario_for_world
    from ddenv.world.access import write_file
    from ddenv.world.placement import note_inside
    from ddenv.world.sdf.moved import with_places
    from ddenv.world.sdf.read import read_model

    if output.resolve() == world.path.resolve():
        raise UserError(f"{output}: is the world itself; choose another file")
    able = sum(bool(model.links) and not model.static for model in world.models)
    # Drake's plant needs a robot; piles settle as if there were none.
    scenario = scenario_for_world(world.path, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0))
    with announced(f"settling {count(able, 'model')} that can move"):
        settled = Variants(world, read_model(scenario.robot.model), scenario).settled()
    for about, words in (*note_inside(world), *notes_on(world, settled)):
        if about != "unrest":
            announce(words)
    places = {name: links for name, links in settled.places.items() if name not in settled.fallen}
    text, stay = with_places(world, places, reading)
    write_file(output, text)
    ways = {name: way for name, way in moved(world, settled).items() if name not in stay and way > 0}
    farthest = max(ways, key=lambda name: ways[name], default="")
    far = f", {farthest} farthest, by {ways[farthest]:.3f} m" if farthest else ""
    lines = [f"wrote {output}: {count(len(ways), 'model')} moved within {settled.seconds:.1f} s{far}"]
    if stay:
        lines.append(
            f"not moved: {first_of(stay, MOST_NAMES)}: their parts move, or others are placed relative to them"
        )
    return lines
