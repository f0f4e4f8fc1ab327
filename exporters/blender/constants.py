"""What inputs of nodes always are: values that hang on no image, no place and no ray, through the nodes that make such."""

from __future__ import annotations

import bpy
import numpy as np

from .nodes import source

SCALARS = ("VALUE", "INT", "BOOLEAN")
Constant = float | np.ndarray
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
_XYZ_TO_RGB = np.array([[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]])
# Wyman, Sloan and Shirley, Simple Analytic Approximations to the CIE XYZ Color Matching Functions (2013): height, centre and
# widths to both sides, in nanometres.
_OBSERVER = (
    ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
    ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
    ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
)


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


def blackbody(temperature: float) -> np.ndarray:
    """The colour of Blender's Blackbody node: Planck's law as an eye sees it, of luminance 1."""
    temperature = min(max(temperature, 800.0), 12000.0)
    wave = np.arange(380.0, 781.0)
    shone = wave**-5 / np.expm1(1.4387769e7 / (wave * temperature))
    xyz = np.array([sum(_lobe(wave, *lobe) for lobe in lobes) @ shone for lobes in _OBSERVER])
    return np.maximum(_XYZ_TO_RGB @ (xyz / xyz[1]), 0.0)


def _lobe(wave: np.ndarray, height: float, centre: float, left: float, right: float) -> np.ndarray:
    return height * np.exp(-0.5 * ((wave - centre) / np.where(wave < centre, left, right)) ** 2)


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
