"""FitNumbers: the numbers of a vehicle that a log can determine, and their prior.

A log knows neither mass nor lengths, only ratios to them: thrust over mass, inertia over mass and
arm. Speeds of rotors are in shares of the full command at the reference voltage.
"""

from __future__ import annotations

from typing import NamedTuple


class FitNumbers(NamedTuple):
    """The numbers that a fit searches."""

    # time from a motor's command to the begin of its answer in the gyro [s]
    delay: float
    # lag of the rotors' speed [s]
    tau: float
    # thrust of one rotor over the mass, c2 s^2 + c1 s + c0 at the speed s [m/s^2]
    c2: float
    c1: float
    c0: float
    # A rotor's speed grows with this power of the battery's voltage.
    voltage_power: float
    # linear drag along the body's axes [1/s]
    drag_x: float
    drag_y: float
    drag_z: float
    # inertia over mass and lever arm about x, y, z: thrusts over mass divided by it are angular
    # accelerations; about z the lever is the reaction torque per thrust [m]
    inertia_x: float
    inertia_y: float
    inertia_z: float
    # inertia about z over the mean of the other two, which gyroscopic torques tell
    flatness: float
    # share of the thrust that turns the vehicle, by a centre of mass off the middle
    offset_x: float
    offset_y: float
    offset_z: float
    # Rotors that speed up push the vehicle round, too: its yaw sees their thrust ahead by this [s]
    yaw_lead: float
    # bias of the accelerometer [m/s^2]
    bias_x: float
    bias_y: float
    bias_z: float
    # direction of the thrust in the accelerometer's axes and in the pose's, x and y [rad]
    tilt_x: float
    tilt_y: float
    pose_tilt_x: float
    pose_tilt_y: float
    # sideways force per thrust and body rate: blades that flap, or an accelerometer whose axes are
    # read later than its forces [s]
    flapping: float
    # time by which the accelerometer, which is often filtered, is later than the gyro [s]
    force_lag: float
    # time by which the velocity is later than the gyro [s]
    velocity_lag: float


class Prior(NamedTuple):
    """The mean and standard deviation that a number has before a log is read."""

    mean: float
    std: float
    low: float
    high: float
