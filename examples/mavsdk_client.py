"""Fly `race serve` by MAVSDK-Python: take off, then fly through the first gate to the north.

    pip install mavsdk-grpc
    race serve --competition aigp_physical --sensing perfect --laps 1 --camera none &
    python examples/mavsdk_client.py

The calls are those of MAVSDK's examples of offboard control, and none of them is made for quadsim.
"""

import asyncio
import sys

from mavsdk_grpc import System
from mavsdk_grpc.offboard import AttitudeRate, PositionNedYaw, VelocityNedYaw

PORT = sys.argv[1] if sys.argv[1:] else "14550"
HEIGHT = 1.35  # [m] of the gate's centre
HOVER = 0.2  # share of full thrust: 1 / thrust-to-weight of the vehicle


async def first(stream, suits=lambda value: True):
    """Return the first value of a stream that suits."""
    async for value in stream:
        if suits(value):
            return value


async def fly():
    """Connect, arm, and fly by attitude rates, by position, and by velocity."""
    drone = System()
    await drone.connect(system_address=f"udpin://127.0.0.1:{PORT}")
    await first(drone.core.connection_state(), lambda state: state.is_connected)
    await first(drone.telemetry.health_all_ok(), lambda is_ok: is_ok)
    await drone.action.arm()
    print("armed")

    await drone.offboard.set_attitude_rate(AttitudeRate(0.0, 0.0, 0.0, 1.2 * HOVER))
    await drone.offboard.start()
    mode = await first(drone.telemetry.flight_mode())
    print("offboard", mode)
    await asyncio.sleep(0.5)

    start = (await first(drone.telemetry.position_velocity_ned())).position
    above = PositionNedYaw(start.north_m, start.east_m, -HEIGHT, 0.0)
    await drone.offboard.set_position_ned(above)
    await first(
        drone.telemetry.position_velocity_ned(), lambda now: abs(now.position.down_m + HEIGHT) < 0.1
    )
    print(f"at a height of {HEIGHT} m")

    await drone.offboard.set_velocity_ned(VelocityNedYaw(3.0, 0.0, 0.0, 0.0))
    await asyncio.sleep(4.0)
    now = (await first(drone.telemetry.position_velocity_ned())).position
    print(f"flew {now.north_m - start.north_m:.1f} m to the north")
    await drone.offboard.stop()


asyncio.run(fly())
