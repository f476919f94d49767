"""Seeded damage to texts, bytes, numbers and JSON."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

WORDS = (
    "", " ", "-1", "0", "-0.0", "1", "2", "3.5", "1e-9", "1e9", "1e400", "nan", "inf", "-inf",
    "9" * 30, "0x10", "1_000", "1,2", "1:2:3", "true", "None", "null", "~", "[]", "{}", "x", "ä",
    "\x1b[31m", "a\tb", "a\nb", "'", '"', "--", "-", "=", "%s", "[red]", "../..", ".", "/",
    "x" * 300, "no.yaml", "x.y:Z",
)  # fmt: skip
VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 1, 2**70, -0.5, 1e308, "", "x", "nan", [], [1], [[]], {}, {"x": 1},
    "\x1b[2J", "../x", ["x"] * 3,
)  # fmt: skip

CHARACTERS = "{}[]:,&*!|>'\"%@#\x00\x7f\u2028é-"


def damaged_bytes(rng: random.Random, data: bytes) -> bytes:
    """Return bytes cut short, emptied, with bits changed, or with a part lost or overwritten."""
    if not data:
        return rng.randbytes(10)
    a, b = sorted((rng.randrange(len(data)), rng.randrange(len(data) + 1)))
    match rng.randrange(7):
        case 0:
            return data[:a]
        case 1:
            return b""
        case 2:
            changed = bytearray(data)
            for _ in range(rng.choice((1, 1, 8))):
                changed[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            return bytes(changed)
        case 3:
            return data[:a] + data[b:]
        case 4:
            return data[:b] + data[a:]
        case 5:
            return data[:a] + rng.randbytes(min(b - a, 64)) + data[a + min(b - a, 64) :]
        case _:
            return data[:a] + bytes(b - a) + data[b:]


def damaged_text(rng: random.Random, text: str) -> str:
    """Return a text with lines lost, doubled or moved, and words or characters replaced."""
    for _ in range(rng.choice((1, 1, 2, 5))):
        lines = text.split("\n")
        i = rng.randrange(len(lines))
        match rng.randrange(7):
            case 0:
                del lines[i]
            case 1:
                lines.insert(rng.randrange(len(lines)), lines[i])
            case 2:
                lines[i] = rng.choice((" ", "  ", "\t", "- ", "-")) + lines[i]
            case 3 | 4:
                spaced = lines[i].replace(",", " , ").replace("]", " ]").replace("}", " }")
                parts = spaced.split(" ")
                parts[rng.randrange(len(parts))] = rng.choice(WORDS)
                lines[i] = " ".join(parts)
            case 5:
                at = rng.randrange(len(lines[i]) + 1)
                lines[i] = lines[i][:at] + rng.choice(CHARACTERS) + lines[i][at:]
            case _:
                at = rng.randrange(len(lines[i]) + 1)
                lines[i] = lines[i][:at] + lines[i][at + 1 :]
        text = "\n".join(lines) or "x"
    return text


def damaged_json(rng: random.Random, text: str) -> str:
    """Return JSON with values replaced, lost or renamed; now and then it is no JSON any more."""
    if rng.random() < 0.15:
        return damaged_text(rng, text)
    root = json.loads(text)
    for _ in range(rng.choice((1, 1, 1, 3))):
        places = list(_places(root))
        if not places:
            break
        holder, key = rng.choice(places)
        match rng.randrange(6):
            case 0:
                del holder[key]
            case 1 if isinstance(holder, dict):
                holder[rng.choice(("x", "", "\x1b[1m", *map(str, holder)))] = holder.pop(key)
            case _:
                # A copy, as a later change may put a value into another one
                holder[key] = deepcopy(rng.choice(VALUES))
    return json.dumps(root)


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every holder and key below a value; of long lists the first entries."""
    if isinstance(value, dict):
        entries = list(value.items())
    else:
        entries = list(enumerate(value[:5])) if isinstance(value, list) else []
    for key, inside in entries:
        yield value, key
        yield from _places(inside)
