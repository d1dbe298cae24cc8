"""SDF text for models made of boxes and cylinders, of which the `make_*.py` scripts build their
worlds.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

CONCRETE = "0.58 0.58 0.56 1"
ASPHALT = "0.22 0.22 0.24 1"
PINE = "0.80 0.66 0.43 1"
PLYWOOD = "0.62 0.47 0.29 1"

_SUN = """    <light name="sun" type="directional">
      <cast_shadows>true</cast_shadows>
      <pose>0 0 10 0 0 0</pose>
      <diffuse>0.8 0.8 0.8 1</diffuse>
      <specular>0.2 0.2 0.2 1</specular>
      <direction>-0.5 0.3 -1</direction>
    </light>
"""


def numbers(values: Iterable[float]) -> str:
    return " ".join(f"{value:.6g}" for value in values)


def friction(mu: float) -> str:
    return f"<surface><friction><ode><mu>{mu}</mu><mu2>{mu}</mu2></ode></friction></surface>"


def material(color: str) -> str:
    return f"<material><ambient>{color}</ambient><diffuse>{color}</diffuse></material>"


def part(name: str, position: Sequence[float], geometry: str, mu: float, color: str) -> str:
    """A collision and a visual of the same shape. SDF wants different names for all parts of a
    link.
    """
    return collision(name, position, geometry, mu) + visual(
        f"{name}_visual", position, geometry, color
    )


def collision(name: str, position: Sequence[float], geometry: str, mu: float) -> str:
    """A shape that can be touched but not seen."""
    shape = f"<pose>{numbers(position)} 0 0 0</pose><geometry>{geometry}</geometry>"
    return f'        <collision name="{name}">{shape}{friction(mu)}</collision>\n'


def visual(name: str, position: Sequence[float], geometry: str, color: str) -> str:
    """A shape that can be seen but not touched."""
    shape = f"<pose>{numbers(position)} 0 0 0</pose><geometry>{geometry}</geometry>"
    return f'        <visual name="{name}">{shape}{material(color)}</visual>\n'


def box(name: str, position: Sequence[float], size: Sequence[float], mu: float, color: str) -> str:
    return part(name, position, f"<box><size>{numbers(size)}</size></box>", mu, color)


def round_shape(radius: float, length: float) -> str:
    return f"<cylinder><radius>{radius:g}</radius><length>{length:g}</length></cylinder>"


def model(name: str, pose: Sequence[float], parts: str, inertial: str = "") -> str:
    """A model at `pose` (x, y, z m, roll, pitch, yaw rad); it can move if it has an `inertial`."""
    static = "" if inertial else "      <static>true</static>\n"
    return (
        f'    <model name="{name}">\n{static}      <pose>{numbers(pose)}</pose>\n'
        f'      <link name="link">\n{inertial}{parts}      </link>\n    </model>\n'
    )


def box_inertial(mass: float, size: Sequence[float]) -> str:
    """The inertia of a solid box (kg, m) about its centre."""
    x, y, z = (side * side for side in size)
    moments = {"ixx": y + z, "iyy": x + z, "izz": x + y}
    inertia = "".join(
        f"<{name}>{mass / 12 * value:.6g}</{name}>" for name, value in moments.items()
    )
    zeros = "".join(f"<{name}>0</{name}>" for name in ("ixy", "ixz", "iyz"))
    return (
        f"        <inertial><mass>{mass:g}</mass><inertia>{inertia}{zeros}</inertia></inertial>\n"
    )


def ground(color: str, mu: float | None = None, pose: Sequence[float] = ()) -> str:
    """The infinite ground plane: level and at height 0 unless `pose` says otherwise."""
    place = f"      <pose>{numbers(pose)}</pose>\n" if pose else ""
    surface = "" if mu is None else friction(mu)
    plane = "<geometry><plane><normal>0 0 1</normal><size>60 60</size></plane></geometry>"
    return (
        '    <model name="ground_plane">\n      <static>true</static>\n'
        f'{place}      <link name="link">\n        <collision '
        f'name="ground">{plane}{surface}</collision>\n'
        f'        <visual name="ground_visual">\n          {plane}\n          '
        f"{material(color)}\n        </visual>\n"
        "      </link>\n    </model>\n"
    )


def world(name: str, models: Iterable[str]) -> str:
    head = (
        f'<?xml version="1.0"?>\n<sdf version="1.9">\n  <world name="{name}">\n    <gravity>0 0 '
        "-9.81</gravity>\n"
    )
    return f"{head}{_SUN}{''.join(models)}  </world>\n</sdf>\n"
