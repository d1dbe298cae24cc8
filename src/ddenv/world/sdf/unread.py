"""Elements that are passed over: those that need no word, and those that get a note."""

from __future__ import annotations

from ddenv.world.sdf.context import Context
from ddenv.world.sdf.xml import Element

# What is read, and what says nothing about how a robot drives, by the element that it is in.
QUIET: dict[str, frozenset[str]] = {
    tag: frozenset(children.split())
    for tag, children in {
        "world": "model include state frame gravity light gui scene physics spherical_coordinates magnetic_field "
        "atmosphere audio",
        "model": "link joint model include frame pose static self_collide allow_auto_disable",
        "link": "pose inertial collision visual gravity self_collide kinematic light must_be_base_link velocity_decay",
        "collision": "pose geometry surface max_contacts laser_retro density auto_inertia_params",
        "visual": "pose geometry material cast_shadows transparency laser_retro meta visibility_flags",
    }.items()
}
ONCE = frozenset(
    ["pose", "geometry", "inertial", "surface", "material", "static", "scale", "gravity", "self_collide", "density"]
)
REASONS = {
    "plugin": "plugins do not run here",
    "sensor": "only the robot's own sensors are simulated",
    "actor": "nothing can touch it",
    "road": "it is not drawn",
    "wind": "no wind blows here",
    "enable_wind": "no wind blows here",
    "gripper": "nothing grips here",
    "projector": "it is not drawn",
    "particle_emitter": "it is not drawn",
    "audio_source": "nothing is heard here",
    "audio_sink": "nothing is heard here",
    "battery": "it never runs out",
}


def note_unread(element: Element, context: Context) -> None:
    """Notes every child of `element` that is neither read nor without meaning here."""
    quiet = QUIET[element.tag]
    once: set[str] = set()
    for child in element:
        if child.tag in ONCE:
            if child.tag in once:
                context.note("ignored", child, f"only the first <{child.tag}> counts")
            once.add(child.tag)
        if child.tag not in quiet:
            extension = "}" in child.tag or ":" in child.tag
            context.note("ignored", child, REASONS.get(child.tag, _unknown(extension)))


def _unknown(extension: bool) -> str:
    return "an extension of SDF that is not known here" if extension else "no element of SDF that is known here"
