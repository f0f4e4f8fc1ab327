"""What inputs of nodes always are: values that hang on no image, no place and no ray, through the nodes that make such."""

from __future__ import annotations

import bpy
import numpy as np

from .nodes import source

SCALARS = ("VALUE", "INT", "BOOLEAN")
Constant = float | np.ndarray
# A lamp that stands nowhere: it is asked for the colour of temperatures.
_LAMP = "blackbody"
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_MATH = {
    "ADD": lambda a, b: a + b,
    "SUBTRACT": lambda a, b: a - b,
    "MULTIPLY": lambda a, b: a * b,
    # Blender gives 0 where there is no answer.
    "DIVIDE": lambda a, b: a / b if b else 0.0,
    "MINIMUM": min,
    "MAXIMUM": max,
}


def constant(socket: bpy.types.NodeSocket) -> Constant | None:
    """The value of an input, in its own type: a number, or three. None if it is not the same everywhere."""
    out = source(socket)
    if out is None:
        return None if socket.is_linked else own_value(socket)
    value = _output(out)
    return None if value is None else converted(value, out.type, socket.type)


def own_value(socket: bpy.types.NodeSocket) -> Constant | None:
    """The value that stands in a socket itself."""
    if socket.type in SCALARS:
        return float(socket.default_value)
    return np.array(socket.default_value)[:3] if socket.type in ("RGBA", "VECTOR") else None


def put(socket: bpy.types.NodeSocket, value: Constant) -> None:
    """Write a value of its type into a socket."""
    if socket.type in SCALARS:
        socket.default_value = type(socket.default_value)(value)
    else:
        socket.default_value = (*value, 1.0) if socket.type == "RGBA" else value


def converted(value: Constant, start: str, end: str) -> Constant:
    """What a link between sockets of two types makes of a value."""
    if (start in SCALARS) == (end in SCALARS):
        return value
    if start in SCALARS:
        return np.full(3, value)
    return float(_LUMINANCE @ value if start == "RGBA" else np.mean(value))


def blackbody(temperature: float) -> np.ndarray | None:
    """The colour of a Blackbody node, as Blender has it of a lamp; None in those that know no temperature of lamps."""
    lamp = bpy.data.lights.get(_LAMP) or bpy.data.lights.new(_LAMP, "POINT")
    if not hasattr(lamp, "temperature_color"):
        return None
    lamp.use_temperature, lamp.temperature = True, temperature
    return np.array(lamp.temperature_color)


def _output(out: bpy.types.NodeSocket) -> Constant | None:
    node = out.node
    if node.mute:
        return None
    if node.type in ("VALUE", "RGB"):
        return own_value(out)
    if node.type == "BLACKBODY":
        temperature = constant(node.inputs["Temperature"])
        return None if temperature is None else blackbody(temperature)
    if node.type == "MATH" and node.operation in _MATH:
        sides = [constant(socket) for socket in node.inputs[:2]]
        if None in sides:
            return None
        value = _MATH[node.operation](*sides)
        return min(max(value, 0.0), 1.0) if node.use_clamp else value
    return None
