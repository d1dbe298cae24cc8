"""The sizes of Gazebo's common models, for stand-ins."""

from __future__ import annotations

from dataclasses import dataclass

from ddenv.world.files.resolve import model_named
from ddenv.world.pose import ONE, Vector


@dataclass(frozen=True)
class Known:
    """A stand-in's text, in the frame of the model as of its mesh; its mesh is drawn to that size with `scale`."""

    text: str
    scale: Vector = ONE


# From the collisions and meshes in github.com/osrf/gazebo_models: the box around the model, or the cylinder. Of the barrel
# without its flat foot, which has a radius of 0.51 m. Only models whose mesh has the frame of the model.
SIZES = {
    "asphalt_plane": Known("box:20,20,0.1@0,0,0"),
    "beer": Known("cylinder:0.055,0.23@0,0,0"),
    "bookshelf": Known("box:0.92,0.405,1.2@0,-0.1925,0.6"),
    "brick_box_3x1x3": Known("box:3,1,3"),
    "cabinet": Known("box:0.47,0.49,1.02@0.01,0,0.51"),
    "cafe_table": Known("box:0.913,0.913,0.775"),
    "cardboard_box": Known("box:0.5,0.4,0.3", (1.259, 1.007, 0.756)),
    "cinder_block": Known("box:0.435,0.203,0.203"),
    "cinder_block_2": Known("box:0.194,0.397,0.143"),
    "cinder_block_wide": Known("box:0.387,0.387,0.143"),
    "construction_barrel": Known("cylinder:0.296,1.315"),
    "construction_cone": Known("cylinder:0.251,1.089", (10.0, 10.0, 10.0)),
    "cricket_ball": Known("sphere:0.0375"),
    "drc_practice_2x4": Known("box:1.219,0.038,0.089@0,0,0"),
    "drc_practice_2x6": Known("box:1.219,0.038,0.14@0,0,0"),
    "drc_practice_4x4x20": Known("box:0.508,0.089,0.089@0,0,0"),
    "drc_practice_4x4x40": Known("box:1.016,0.089,0.089@0,0,0"),
    "jersey_barrier": Known("box:4.065,0.811,1.143"),
    "table": Known("box:1.5,0.8,1.015"),
    "wood_cube_10cm": Known("box:0.1,0.1,0.1"),
}


def known_size(uri: str) -> Known | None:
    """The size of the model that `uri` names, or of its mesh."""
    return SIZES.get(model_named(uri))
