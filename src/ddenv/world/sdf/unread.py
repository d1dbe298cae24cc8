"""Elements that are passed over: those that need no word, and those that get a note."""

from __future__ import annotations

from ddenv.world.sdf.context import Context
from ddenv.world.sdf.xml import Element, floats

# What is read, and what has no part in how a robot drives, by the element that it is in.
QUIET: dict[str, frozenset[str]] = {
    tag: frozenset(children.split())
    for tag, children in {
        "world": "model include state frame gravity light gui scene physics spherical_coordinates magnetic_field "
        "atmosphere audio",
        "model": "link joint model include frame pose static self_collide allow_auto_disable",
        "include": "uri name pose placement_frame static",
        "link": "pose inertial collision visual gravity self_collide kinematic light must_be_base_link velocity_decay",
        "inertial": "mass inertia pose density auto_inertia_params",
        "inertia": "ixx ixy ixz iyy iyz izz",
        "collision": "pose geometry surface max_contacts laser_retro density auto_inertia_params",
        "surface": "friction bounce contact soft_contact",
        "friction": "ode bullet torsional",
        "bounce": "restitution_coefficient threshold",
        "visual": "pose geometry material cast_shadows transparency laser_retro meta visibility_flags",
        "joint": "pose parent child axis axis2 physics thread_pitch screw_thread_pitch gearbox_ratio "
        "gearbox_reference_body",
        "axis": "xyz limit dynamics use_parent_model_frame initial_position",
        "limit": "lower upper effort velocity stiffness dissipation",
        "dynamics": "damping friction spring_reference spring_stiffness",
        "velocity_decay": "linear angular",
    }.items()
}
QUIET["axis2"] = QUIET["axis"]
ONCE = {"pose", "geometry", "inertial", "surface", "material", "static", "scale", "gravity", "self_collide", "density"}
ONCE |= {"axis", "axis2", "parent", "child", "limit"}
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
    "mimic": "no joint follows another",
}
# What would change how things move if it were simulated, by its parent and itself, and how it is without.
WITHOUT = {
    ("dynamics", "friction"): "joints turn without dry friction",
    ("dynamics", "spring_stiffness"): "joints have no springs",
    ("bounce", "restitution_coefficient"): "nothing bounces",
    ("velocity_decay", "linear"): "nothing but contacts and joints slows a link down",
    ("velocity_decay", "angular"): "nothing but contacts and joints slows a link down",
}


def note_unread(element: Element, context: Context) -> None:
    """Notes what is in `element`, and in what belongs to it alone, that is neither read nor without meaning here."""
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
        elif len(child):
            _note_inside(child, context)
        elif (element.tag, child.tag) in WITHOUT and any(floats(child)):
            context.note("ignored", child, WITHOUT[element.tag, child.tag])


# Those of them that are not read by a function of their own, which would note them again.
INSIDE = frozenset(
    ["inertial", "inertia", "surface", "friction", "bounce", "axis", "axis2", "limit", "dynamics", "velocity_decay"]
)


def _note_inside(child: Element, context: Context) -> None:
    if child.tag in INSIDE:
        note_unread(child, context)


def _unknown(extension: bool) -> str:
    return "an extension of SDF that is not known here" if extension else "no element of SDF that is known here"
