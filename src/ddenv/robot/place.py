"""Poses and inertias as Drake has them."""

from __future__ import annotations

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform
from pydrake.multibody.tree import RotationalInertia, SpatialInertia

from ddenv.world.model import Inertia
from ddenv.world.pose import Pose


def transform(pose: Pose) -> RigidTransform:
    """`pose` as Drake's transform."""
    return RigidTransform(Quaternion(np.array(pose.quaternion)), np.array(pose.position))


def spatial_inertia(inertia: Inertia, link: Pose) -> SpatialInertia:
    """`inertia` about the origin of the frame `link`, in its axes. Raises RuntimeError for impossible inertias."""
    place = transform(link.inverse() @ inertia.pose)
    central = RotationalInertia(*inertia.moments, *inertia.products).ReExpress(place.rotation())
    return SpatialInertia.MakeFromCentralInertia(inertia.mass, place.translation(), central)
