"""The two models that almost every Gazebo world includes, for machines that do not have Gazebo's models."""

from __future__ import annotations

from pathlib import Path

from ddenv.world.files.resolve import model_named

# In place of a folder: messages name it.
FOLDER = Path("built in")
# As in Gazebo's own models: the ground has no end, and wheels grip it.
_TEXTS = {
    "sun": "<light name='sun' type='directional'/>",
    "ground_plane": (
        "<model name='ground_plane'><static>true</static><link name='link'>"
        "<collision name='collision'><geometry><plane><normal>0 0 1</normal><size>100 100</size></plane></geometry>"
        "<surface><friction><ode><mu>100</mu><mu2>50</mu2></ode></friction></surface></collision>"
        "<visual name='visual'><geometry><plane><normal>0 0 1</normal><size>100 100</size></plane></geometry>"
        "<material><script><name>Gazebo/Grey</name></script></material></visual></link></model>"
    ),
}


def built_in(uri: str) -> tuple[Path, bytes] | None:
    """A name in place of a path, and the SDF text, of the built-in model that `uri` names; None if there is none."""
    name = model_named(uri)
    text = _TEXTS.get(name)
    return None if text is None else (FOLDER / f"{name}.sdf", f"<sdf version='1.5'>{text}</sdf>".encode())
