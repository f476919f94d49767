"""A flight whose signals are known, and files in which the logs of others have it."""

import struct
from math import pi
from zlib import crc32

import numpy as np

from quadsim.logs.frames import products
from quadsim.rotation import to_body

G = 9.80665
ROWS = 400
RATE = 100.0


def known_signals(rows=ROWS):
    """Return time and signals of a flight: it rolls and turns while it climbs in a curve.

    The attitude is the integral of the body rates, the velocity the derivative of the position, and
    the accelerometer measures the acceleration in the body's axes, without the free fall.
    """
    t = np.arange(rows) / RATE
    rates = np.stack((2.0 * np.cos(3.0 * t), np.sin(2.0 * t), 0.5 + 0.0 * t), axis=1)
    attitude = [np.array((1.0, 0.0, 0.0, 0.0))]
    for w in rates[:-1]:
        half = 0.5 / RATE * w
        turn = np.array((1.0, *half)) / np.hypot(1.0, np.linalg.norm(half))
        attitude.append(products(attitude[-1], turn))
    rise = np.stack((-np.sin(t), np.cos(t), G + 0.0 * t), axis=1)
    return t, {
        "position": np.stack((np.sin(t), 1.0 - np.cos(t), 0.3 * t), axis=1),
        "velocity": np.stack((np.cos(t), np.sin(t), 0.3 + 0.0 * t), axis=1),
        "quaternion": np.array(attitude),
        "body_rates": rates,
        "specific_force": np.stack(to_body(np.array(attitude).T, rise.T), axis=1),
        # front right, rear left, front left, rear right
        "motor_commands": np.stack([0.4 + 0.01 * k + 0.1 * np.sin(t) for k in range(4)], axis=1),
        "battery": 16.0 - 0.01 * t,
    }


def write_csv(path, columns):
    """Write a table of numbers."""
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(f"{x:.9g}" for x in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def nanobench_columns():
    """Return the known flight as NanoBench writes it."""
    t, s = known_signals()
    order = dict(zip(("m1", "m3", "m4", "m2"), s["motor_commands"].T, strict=True))
    return {
        # The clock of a computer, with its digits
        "t": 1.7e6 + t,
        **dict(zip(("px", "py", "pz"), s["position"].T, strict=True)),
        **dict(zip(("vx", "vy", "vz"), s["velocity"].T, strict=True)),
        **{f"q{k}": s["quaternion"][:, i] for i, k in zip((1, 2, 3, 0), "xyzw", strict=True)},
        **{f"imu_acc_{k}": s["specific_force"][:, i] / G for i, k in enumerate("xyz")},
        **{f"imu_gyro_{k}": s["body_rates"][:, i] for i, k in enumerate("xyz")},
        **{f"motor_motor_m{k}": order[f"m{k}"] * 65535 for k in range(1, 5)},
        "pid_controller_cmd_thrust": 0.5 * 65535 + 0.0 * t,
        "pwr_pm_vbat": s["battery"],
    }


def crazyflie_bytes(version=2, other_events=False):
    """Return the known flight as the Crazyflie's SD card deck writes it."""
    t, s = known_signals()
    motors = dict(zip(("m1", "m3", "m4", "m2"), s["motor_commands"].T, strict=True))
    names = [f"{group}.{axis}(f)" for group in ("acc", "gyro") for axis in "xyz"]
    names += [f"motor.m{k}(I)" for k in range(1, 5)]
    head = struct.pack("<BHH", 0xBC, version, 1 + other_events)
    if other_events:
        head += struct.pack("<H", 7) + b"estPose\0" + struct.pack("<H", 1) + b"id(B)\0"
    head += struct.pack("<H", 0xFFFF) + b"fixedFrequency\0" + struct.pack("<H", len(names))
    head += b"".join(name.encode() + b"\0" for name in names)
    stamp, second = ("<HQ", 1e6) if version == 2 else ("<HI", 1e3)
    body = b""
    for k in range(len(t)):
        now = round((20.0 + t[k]) * second)
        if other_events and k % 3 == 0:
            body += struct.pack(stamp, 7, now) + b"\x05"
        pwm = [round(65535 * motors[f"m{n}"][k]) for n in range(1, 5)]
        values = (*(s["specific_force"][k] / G), *np.degrees(s["body_rates"][k]))
        body += struct.pack(stamp, 0xFFFF, now) + struct.pack("<6f4I", *values, *pwm)
    return head + body + struct.pack("<I", crc32(head + body))


BLACKBOX_FIELDS = (
    *("loopIteration", "time", "setpoint[0]", "setpoint[1]", "setpoint[2]", "setpoint[3]"),
    *("vbatLatest", "gyroADC[0]", "gyroADC[1]", "gyroADC[2]"),
    *("accSmooth[0]", "accSmooth[1]", "accSmooth[2]"),
    *("motor[0]", "motor[1]", "motor[2]", "motor[3]", "eRPM[0]", "eRPM[1]", "eRPM[2]", "eRPM[3]"),
)


def blackbox_bytes(rows=range(ROWS), output="158,2047", without=()):
    """Return the known flight as Betaflight writes it: frames of whole values and of differences.

    Args:
        rows: rows of the flight.
        output: the header's motorOutput.
        without: fields that the log lacks.
    """
    t, s = known_signals()
    names = [name for name in BLACKBOX_FIELDS if name.partition("[")[0] not in without]
    digital = output.startswith("158")
    low, span = (48.0, 1999.0) if digital else (1000.0, 1000.0)
    # Betaflight's motors are rear right, front right, rear left, front left.
    ours = s["motor_commands"][:, [3, 0, 1, 2]]
    columns = {
        "loopIteration": 16.0 * np.arange(len(t)),
        "time": 3e7 + 1e6 * t,
        "setpoint[3]": 500.0 + 0.0 * t,
        "vbatLatest": 100.0 * s["battery"],
        **{f"setpoint[{k}]": np.degrees(s["body_rates"][:, k]) for k in range(3)},
        **{f"gyroADC[{k}]": np.degrees(s["body_rates"][:, k]) for k in range(3)},
        **{f"accSmooth[{k}]": 2048.0 / G * s["specific_force"][:, k] for k in range(3)},
        **{f"motor[{k}]": low + span * ours[:, k] for k in range(4)},
        # A speed of 1000 rad/s with 14 poles, in hundreds of electrical revolutions a minute
        **{f"eRPM[{k}]": 1000.0 * 30.0 / pi * 7.0 / 100.0 + 0.0 * t for k in range(4)},
    }
    table = np.rint(np.stack([columns[name] for name in names], axis=1)).astype(int)
    zeros = ",".join("0" for _ in names)
    ones = ",".join("1" for _ in names)
    lines = [
        "Product:Blackbox flight data recorder by Nicholas Sherlock",
        "Data version:2",
        f"Field I name:{','.join(names)}",
        f"Field I signed:{ones}",
        f"Field I predictor:{zeros}",
        f"Field I encoding:{zeros}",
        # Differences to the frame before
        f"Field P predictor:{ones}",
        f"Field P encoding:{zeros}",
        "Firmware revision:Betaflight 4.4.0",
        "gyro_scale:0x3f800000",
        "acc_1G:2048",
        f"motorOutput:{output}",
        "motor_poles:14",
    ]
    data = b"".join(f"H {line}\n".encode() for line in lines)
    for k in rows:
        is_whole = k % 16 == 0
        data += b"I" if is_whole else b"P"
        numbers = table[k] if is_whole else table[k] - table[k - 1]
        data += b"".join(map(_signed, numbers.tolist()))
    return data + b"E\xffEnd of log\0"


def _signed(number):
    """Return a whole number as the blackbox writes it: zigzag, then seven bits a byte."""
    number = number << 1 if number >= 0 else (-number << 1) - 1
    found = bytearray()
    while number > 0x7F:
        found.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*found, number])


# Topics of a log of PX4: the fields besides the time, and how many rows of the flight apart
FRD = (1.0, -1.0, -1.0)


def ulog_bytes(**more):
    """Return the known flight as PX4 writes it: north, east, down and forward, right, down.

    Args:
        more: topic -> {field: values of the rows}, besides those of the flight.
    """
    t, s = known_signals()
    half = np.array((0.0, 1.0, 0.0, 0.0))
    to_ned = np.array((0.0, 0.5**0.5, 0.5**0.5, 0.0))
    # Both half turns are their own inverses, but for the sign, which an attitude does not have.
    attitude = products(products(to_ned, s["quaternion"]), half)
    place = s["position"][:, [1, 0, 2]] * (1.0, 1.0, -1.0)
    velocity = s["velocity"][:, [1, 0, 2]] * (1.0, 1.0, -1.0)
    topics = {
        "vehicle_angular_velocity": (1, {"float[3] xyz": s["body_rates"] * FRD}),
        "vehicle_acceleration": (1, {"float[3] xyz": s["specific_force"] * FRD}),
        "vehicle_attitude": (2, {"float[4] q": attitude}),
        "vehicle_local_position": (
            4,
            {f"float {name}": place[:, k] for k, name in enumerate("xyz")}
            | {f"float v{name}": velocity[:, k] for k, name in enumerate("xyz")},
        ),
        "actuator_motors": (1, {"float[4] control": s["motor_commands"]}),
        "battery_status": (50, {"float voltage_v": s["battery"]}),
        **{
            name: (1, {f"float {field}": values for field, values in fields.items()})
            for name, fields in more.items()
        },
    }
    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    messages = []
    for number, (name, (step, fields)) in enumerate(topics.items()):
        written = "".join(f"{field};" for field in ("uint64_t timestamp", *fields))
        data += _message(b"F", f"{name}:{written}".encode())
        for k in range(0, len(t), step):
            values = np.concatenate([np.atleast_1d(column[k]) for column in fields.values()])
            stamp = round(5e6 + 1e6 * t[k])
            body = struct.pack("<HQ", number, stamp) + values.astype("<f4").tobytes()
            messages.append((stamp, _message(b"D", body)))
    for number, name in enumerate(topics):
        data += _message(b"A", struct.pack("<BH", 0, number) + name.encode())
    return data + b"".join(message for _, message in sorted(messages))


def _message(kind, body):
    return struct.pack("<H", len(body)) + kind + body
