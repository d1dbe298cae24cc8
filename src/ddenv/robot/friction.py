"""What surfaces are made of: their friction, mapped from Gazebo's rule for pairs to Drake's, and their compliance."""

from __future__ import annotations

from pydrake.geometry import AddContactMaterial, ProximityProperties
from pydrake.multibody.plant import CoulombFriction

from ddenv.robot.drive import Drive, turned_links
from ddenv.world.model import Model

# Every surface has the same compliance, written down because Drake would otherwise derive it from the masses of the
# world, and removing a model would change the contacts of all others. Two such surfaces in series give 1e5 N/m: a
# Husky sinks in by 1.4 mm.
STIFFNESS = 2e5  # N/m
DISSIPATION = 5.0  # s/m, Hunt-Crossley


def wheel_friction(robot: Model, drive: Drive) -> float:
    """The friction coefficient of the robot's driven wheels, the largest if they differ."""
    wheels = turned_links(robot, drive.joints)
    return max((one.mu for link in robot.links if link.name in wheels for one in link.collisions), default=0.0)


def world_friction(mu: float, wheels: float) -> float:
    """The coefficient that Drake is given for a surface of the world, so that the robot's wheels grip it as in Gazebo.

    Gazebo's ODE takes the smaller of two surfaces' coefficients, m = min(mu, wheels). Drake combines a and b as
    2 a b / (a + b), which is m for b = wheels and 1 / a = 2 / m - 1 / b. The robot's own surfaces keep their coefficients. So
    contact with the wheels is exact. Between two surfaces of the world the combination lies between half the smaller and
    the smaller (each taken as at most `wheels`), and is the smaller if the other is at least as rough as the wheels. Between
    another part of the robot and the world it lies between half the smaller and twice the smaller.
    """
    grip = min(mu, wheels)
    return 1.0 / (2.0 / grip - 1.0 / wheels) if grip > 0.0 else 0.0


def surface(mu: float) -> ProximityProperties:
    """A surface with Drake's friction coefficient `mu`.

    Static and dynamic friction are the same: a difference makes wheels stick and slip at the time step's rate.
    """
    properties = ProximityProperties()
    AddContactMaterial(DISSIPATION, STIFFNESS, CoulombFriction(mu, mu), properties)
    return properties
