"""Downwash: the force of a vehicle's rotor flow on a vehicle that flies below.

Far below, the flow of the four rotors is one round turbulent jet. Its momentum flux is the thrust
T, and its velocity has a Gaussian profile whose width grows with the distance s along the jet:

    b(s) = b_0 + 0.107 s,      u(r)^2 = 2 T / (rho pi b^2) exp(-2 r^2 / b^2)

(Fischer, List, Koh, Imberger and Brooks, Mixing in Inland and Coastal Waters, 1979, section 9.2).
b_0 is the width at which the jet's effective area pi b_0^2 / 2 is half the area of the rotors'
discs, by momentum theory for the contracted wake of a rotor in hover. A vehicle in the jet receives
the momentum that meets its own rotors' discs. For a single disc of their total area A on the jet's
axis, the force is

    F = T (1 - exp(-2 A / (pi b^2)))

and off the axis it is reduced by the profile, exp(-2 r^2 / b^2). The force points along the jet,
opposite to the upper vehicle's thrust. It acts from WAKE to REACH below the upper vehicle. The wake
is straight, as in still air. Half a metre below a Crazyflie the force is 0.53 of its weight here,
and 1.1 in gym-pybullet-drones by a fit to flights; half a metre below a vehicle with propellers of
five inches it is 0.62 here.
"""

from __future__ import annotations

from math import exp, pi, sqrt

from quadsim.dynamics.quadrotor import State
from quadsim.rotation import Vec3, to_world
from quadsim.vehicle import Vehicle

# growth of the jet's width with the distance along it
SPREAD = 0.107
# first and last distance along the jet at which the force acts [m]
WAKE = 0.1
REACH = 10.0


class Downwash:
    """The jet below one vehicle, and the rotor discs on which other jets act."""

    def __init__(self, vehicle: Vehicle):
        """Compute jet and discs from the size of the vehicle's rotors.

        A propeller reaches from its hub to the vehicle's radius along the body's axes. A vehicle
        without rotors has neither jet nor discs.
        """
        self.vehicle = vehicle
        self.area = 0.0
        if vehicle.rotors:
            aside = max(max(abs(x), abs(y)) for x, y in vehicle.rotors.positions)
            propeller = max(vehicle.radius - aside, 0.25 * vehicle.radius)
            # total area of the four discs [m^2]
            self.area = 4.0 * pi * propeller**2
        # width of the jet at the rotors [m]: pi b_0^2 / 2 is half of the discs' area
        self.width = sqrt(self.area / pi)

    def force_on(self, other: Downwash, x: State, x_other: State) -> Vec3 | None:
        """Return the force on another vehicle [N], world frame; None outside the jet.

        Args:
            other: the lower vehicle.
            x: state of the upper vehicle, whose jet acts.
            x_other: state of the lower vehicle.
        """
        if not (self.area and other.area):
            return None
        down_x, down_y, down_z = to_world(x.attitude, (0.0, 0.0, -1.0))
        dx = x_other.px - x.px
        dy = x_other.py - x.py
        dz = x_other.pz - x.pz
        along = dx * down_x + dy * down_y + dz * down_z
        if not WAKE <= along <= REACH:
            return None
        aside_square = max(dx * dx + dy * dy + dz * dz - along * along, 0.0)

        thrust = self.vehicle.mass * x.thrust
        square = (self.width + SPREAD * along) ** 2
        met = 1.0 - exp(-2.0 * other.area / (pi * square))
        force = thrust * met * exp(-2.0 * aside_square / square)
        return force * down_x, force * down_y, force * down_z
