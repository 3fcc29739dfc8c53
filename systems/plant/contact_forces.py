"""Normal forces of the single contacts between peg and block, from the contact results of a plant.

The net wrench does not show them: in a wedge the forces of two contacts cancel, and a peg between two contacts whose
friction cones contain the line between them stays squeezed without any net wrench. No function of the net wrench is
therefore a bound of a contact's force.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import HydroelasticContactInfo, MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context

from compiled import compiled
from skill.arrays import Array, assign
from skill.data.rig_run import ContactPlace
from systems.math.rotation import cross

MIN_GRADIENT = 1e-14
"""Pressure gradient (Pa/m) up to which Drake ignores a face of a contact surface."""

FACE_NORMAL = math.cos(math.radians(30.0))
"""Part of a normal along the axis of the hole above which its contact is on a flat face; on a chamfer it is 0.71."""


@dataclass(frozen=True)
class Contact:
    """One contact between peg and block.

    Attributes:
        place: where it is.
        point: (3,), centre of the normal forces in W, m.
        normal: (3,), unit vector in W along the sum of the normal forces on the peg.
        force: size of this sum, N.
    """

    place: ContactPlace
    point: Array
    normal: Array
    force: float


@dataclass(frozen=True)
class NormalForces:
    """Normal forces of n small parts of the contact, such as the faces of a mesh.

    Attributes:
        points: (n, 3), in W, m.
        normals: (n, 3), unit vectors in W, in which the block pushes the peg.
        forces: (n,), N.
    """

    points: Array
    normals: Array
    forces: Array


@dataclass(frozen=True)
class FaceSprings:
    """The faces of the contact surfaces as springs, n of them, at the end of the plant's last step.

    Attributes:
        points: (n, 3), centroids in W, m.
        normals: (n, 3), unit vectors in W, in which the block pushes the peg.
        stiffnesses: (n,), N/m.
        forces: (n,), elastic forces, N; negative where the faces have separated.
        speeds: (n,), separation speeds, m/s.
    """

    points: Array
    normals: Array
    stiffnesses: Array
    forces: Array
    speeds: Array


def single_contacts(
    parts: NormalForces, X_WH: RigidTransform, X_HP: RigidTransform, *, chamfer: float
) -> list[Contact]:
    """Joins the parts of each contact.

    A part belongs to the ``FACE`` if its normal is within 30 degrees of the hole's axis: the top face or the floor.
    Else it belongs to the ``MOUTH`` if it lies on the chamfer, or is nearer to the chamfer's inner edge than to the
    height of the tip, and to the ``TIP`` if not. A line contact along the wall is thus one contact, at the place that
    is nearer to its middle. Parts at mouth or tip that push towards opposite sides are two contacts. Sides are those of
    the strongest part.

    Args:
        parts: normal forces.
        X_WH: pose of the block.
        X_HP: pose of the peg in the block.
        chamfer: height of the chamfer, m.

    Returns:
        The contacts with a force, at most five, the strongest first.
    """
    R, p = X_WH.rotation().matrix(), X_WH.translation()
    points, normals, forces = (np.ascontiguousarray(values) for values in (parts.points, parts.normals, parts.forces))
    height = X_HP.translation()[2]
    count, found = join_contacts(points, normals, forces, np.ascontiguousarray(R), p, height, chamfer)
    places = list(ContactPlace)
    return [Contact(places[int(row[PLACE])], row[POINT], row[NORMAL], float(row[FORCE])) for row in found[:count]]


def contact_table(contacts: Sequence[Contact]) -> tuple[int, Array]:
    """Returns the number of contacts, at most `MAX_JOINED`, and their table as `join_contacts` does."""
    table = np.zeros((MAX_JOINED, JOINED_SIZE))
    for row, contact in zip(table, contacts, strict=False):
        row[PLACE], row[FORCE] = list(ContactPlace).index(contact.place), contact.force
        row[POINT], row[NORMAL] = contact.point, contact.normal
    return len(contacts), table


GROWTH = 1.05
"""Ratio to the largest load or contact so far from which the single contacts are read between two periods."""


@compiled
def needs_contacts(load: float, extent: float, largest_load: float, largest_extent: float) -> bool:
    """Returns whether the single contacts of a plant step may hold a force larger than those that were read.

    They may if the load or the extent of the contact exceeds the largest so far by a factor of `GROWTH`. This is no
    bound: in a wedge a contact's force can grow while neither does.

    Args:
        load: of the true contact wrench, N.
        extent: see `PegCarrier.contact_extent`.
        largest_load: at a step whose contacts were read, N.
        largest_extent: likewise.
    """
    return extent > 0.0 and (load > GROWTH * largest_load or extent > GROWTH * largest_extent)


MAX_JOINED = 5
"""Largest number of contacts of a pose."""

PLACE, POINT, NORMAL, FORCE, JOINED_SIZE = 0, slice(1, 4), slice(4, 7), 7, 8
"""Places of a row of `join_contacts`: number of the `ContactPlace`, point, normal and force; and its length."""

MOUTH, TIP, FACE = range(3)
"""Numbers of the members of `ContactPlace`."""


@compiled
def join_contacts(
    points: Array, normals: Array, forces: Array, R: Array, p: Array, tip_height: float, chamfer: float
) -> tuple[int, Array]:
    """Returns the number of contacts, and the contacts (MAX_JOINED, JOINED_SIZE); see `single_contacts`.

    Args:
        points: (n, 3), see `NormalForces`.
        normals: (n, 3), likewise.
        forces: (n,), likewise.
        R: (3, 3), R_WH.
        p: (3,), origin of H in W, m.
        tip_height: of the tip above the mouth, m.
        chamfer: height of the chamfer, m.
    """
    n, found, count = len(forces), np.zeros((MAX_JOINED, JOINED_SIZE)), 0
    part, side = np.full(n, -1), np.zeros((n, 2))
    limit = min(-chamfer, 0.5 * (tip_height - chamfer))
    for i in range(n):
        if forces[i] > 0.0:
            height, along = 0.0, 0.0
            for j in range(3):
                height += (points[i, j] - p[j]) * R[j, 2]
                along += normals[i, j] * R[j, 2]
                side[i, 0] += normals[i, j] * R[j, 0]
                side[i, 1] += normals[i, j] * R[j, 1]
            if abs(along) > FACE_NORMAL:
                part[i] = FACE
            else:
                part[i] = MOUTH if height > limit else TIP
    for place in (FACE, MOUTH, TIP):
        strongest = -1
        for i in range(n):
            if part[i] == place and (strongest < 0 or forces[i] > forces[strongest]):
                strongest = i
        for opposite in range(1 if place == FACE else 2):
            total, point, weight, size = np.zeros(3), np.zeros(3), 0.0, 0.0
            for i in range(n):
                along = side[i, 0] * side[strongest, 0] + side[i, 1] * side[strongest, 1]
                if part[i] == place and (place == FACE or (along < 0.0) == (opposite == 1)):
                    weight += forces[i]
                    for j in range(3):
                        total[j] += forces[i] * normals[i, j]
                        point[j] += forces[i] * points[i, j]
            for j in range(3):
                size += total[j] ** 2
            size = math.sqrt(size)
            if size > 0.0:
                k = count
                while k > 0 and found[k - 1, FORCE] < size:  # the strongest first
                    assign(found[k], found[k - 1])
                    k -= 1
                found[k, PLACE], found[k, FORCE] = place, size
                for j in range(3):
                    found[k, 1 + j], found[k, 4 + j] = point[j] / weight, total[j] / size
                count += 1
    return count, found


def hydroelastic_forces(
    plant: MultibodyPlant,
    context: Context,
    *,
    peg: RigidBody,
    block: RigidBody,
    dissipation: float,
) -> NormalForces:
    """Returns the normal force of each face of the contact surfaces in the plant's last step.

    A face of area A whose centroid has the pressure p at the start of the step, with the pressure's gradient g along
    the normal, carries

        f_n = max(0, A p - dt A g v_n) max(0, 1 - d v_n)

    where v_n is the separation speed at the end of the step. This is the law that the plant's solver satisfies in the
    contact approximations "lagged" and "similar" (Castro et al., arXiv:2110.10107 and 2312.03908); "sap" and "tamsi"
    differ from it in their dissipation. The product A p alone, the force of the surface at rest, is wrong by an order
    of magnitude in a step in which stiff bodies separate. Parts of the surface without a gradient carry nothing.

    Args:
        plant: discrete, with sampled output ports, so that its contact results are those of the last step.
        context: of the plant.
        peg: the compliant body.
        block: the rigid body.
        dissipation: d, of the peg's material, s/m.
    """
    springs = face_springs(plant, context, peg=peg, block=block)
    forces = np.maximum(0.0, springs.forces) * np.maximum(0.0, 1.0 - dissipation * springs.speeds)
    return NormalForces(springs.points, springs.normals, forces)


def face_springs(plant: MultibodyPlant, context: Context, *, peg: RigidBody, block: RigidBody) -> FaceSprings:
    """Returns the faces of the contact surfaces as springs; see `hydroelastic_forces`.

    A face has the stiffness A g and, at the end of the step, the elastic force A p - dt A g v_n. A face without a
    gradient has neither.
    """
    results = plant.get_contact_results_output_port().Eval(context)
    surfaces = [results.hydroelastic_contact_info(k) for k in range(results.num_hydroelastic_contacts())]
    if not surfaces:
        return FaceSprings(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0))
    faces = np.concatenate([_faces(info) for info in surfaces])
    points, normals, areas, pressures, gradients = faces[:, :3], faces[:, 3:6], faces[:, 6], faces[:, 7], faces[:, 8]
    speeds = _separation_speeds(context, peg, block, points, normals, step=plant.time_step())
    known = gradients > MIN_GRADIENT
    forces = np.where(known, areas * (pressures - plant.time_step() * gradients * speeds), 0.0)
    return FaceSprings(points, normals, np.where(known, areas * gradients, 0.0), forces, speeds)


def _faces(info: HydroelasticContactInfo) -> Array:
    """(n, 9): centroid, normal into the peg, area, pressure, and gradient of the pressure along minus the normal."""
    surface = info.contact_surface()
    pressure = surface.poly_e_MN()
    if surface.HasGradE_M():  # of the compliant peg; the normals point into M
        sign, gradient = 1.0, surface.EvaluateGradE_M_W
    else:
        sign, gradient = -1.0, surface.EvaluateGradE_N_W
    faces = range(surface.num_faces())
    centroids = [surface.centroid(k) for k in faces]
    found = np.empty((len(faces), 9))
    found[:, :3] = centroids
    found[:, 3:6] = normals = sign * np.array([surface.face_normal(k) for k in faces])
    found[:, 6] = [surface.area(k) for k in faces]
    found[:, 7] = [pressure.EvaluateCartesian(k, point) for k, point in enumerate(centroids)]
    found[:, 8] = (np.array([gradient(k) for k in faces]) * normals).sum(axis=1)
    return found


def _separation_speeds(
    context: Context, peg: RigidBody, block: RigidBody, points: Array, normals: Array, *, step: float
) -> Array:
    """Speeds (n,), m/s, at which the peg moves along the normals relative to the block, at points in W.

    The points are those at the start of the last step, the velocities those at its end. The bodies are moved back.
    """
    turns, speeds = [], []
    for body in (peg, block):
        motion = body.EvalSpatialVelocityInWorld(context)
        origin = body.EvalPoseInWorld(context).translation() - step * motion.translational()
        turns.append(motion.rotational())
        speeds.append(motion.translational() - cross(turns[-1], origin))  # of the point of the body at W's origin
    x, y, z = turns[0] - turns[1]
    crossed = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # points @ crossed is the cross product
    found: Array = ((speeds[0] - speeds[1] + points @ crossed) * normals).sum(axis=1)
    return found
