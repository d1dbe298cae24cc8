"""Small worlds for the tests of maps."""

from pathlib import Path
from xml.sax.saxutils import quoteattr

from ddenv.world.model import World
from ddenv.world.sdf.read import parse_world

GROUND = (
    '<model name="ground_plane"><static>true</static><link name="link"><collision '
    'name="plane"><geometry>'
    "<plane><normal>0 0 1</normal></plane></geometry></collision></link></model>"
)


def box(
    name: str,
    x: float,
    y: float,
    yaw: float = 0.0,
    size: tuple[float, float, float] = (1.2, 0.8, 0.3),
    z: float = 0.0,
    static: bool = True,
    color: str = "",
) -> str:
    """A model that stands at the height `z`; `color` is red, green, blue and alpha."""
    geometry = f"<geometry><box><size>{size[0]} {size[1]} {size[2]}</size></box></geometry>"
    paint = f"<material><diffuse>{color}</diffuse></material>"
    visual = f'<visual name="v">{geometry}{paint}</visual>' if color else ""
    return (
        f"<model name={quoteattr(name)}><static>{str(static).lower()}</static>"
        f'<pose>{x} {y} {z + size[2] / 2} 0 0 {yaw}</pose><link name="link">'
        f'<collision name="c">{geometry}</collision>{visual}</link></model>'
    )


def world_of(*models: str, file: str = "w.sdf") -> World:
    """A world of these models, as XML."""
    text = f'<sdf version="1.9"><world name="w">{"".join(models)}</world></sdf>'.encode()
    return parse_world(text, Path(file))
