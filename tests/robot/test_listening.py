"""Who listens to a controller hears all of it, and changes nothing."""

from ddenv.engine.mcap_file import Streams
from ddenv.robot.simulation.template import Template


def test_a_listener_hears_every_step_and_changes_no_bit(world_of, husky, scenario_of):
    template = Template(world_of(), husky, scenario_of(failure={"timeout": 1.0}))
    streams = Streams()
    quiet, heard = template.run(frozenset(), 3), template.run(frozenset(), 3, listener=streams)
    assert heard.trajectory.tobytes() == quiet.trajectory.tobytes()
    times = [reading.time for reading, _ in streams.heard]
    assert times == sorted(times) and times[0] == 0.0
    assert len(times) * streams.setup.period >= quiet.simulated_seconds
    # A run that is made again is heard from its start.
    template.run(frozenset(), 3, listener=streams)
    assert [reading.time for reading, _ in streams.heard] == times
