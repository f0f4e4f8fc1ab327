"""Procedural textures that tile, and a PNG writer.

Images are float arrays in 0..1, rows from the top; colours are sRGB as glTF stores them.
"""

import struct
import zlib

import numpy as np


def random_stream(seed):
    """A stream of random numbers that NumPy has frozen: the same in every version, as committed scenes need."""
    return np.random.RandomState(seed)


def smoothstep(low, high, x):
    """0 below `low`, 1 above `high`, smooth between."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def noise(size, cells, seed, octaves=4, stretch=1):
    """Fractal value noise in 0..1 with `cells` lattice cells along a side, `stretch` times as many down it."""
    total, weight, amplitude = np.zeros((size, size)), 0.0, 1.0
    for octave in range(octaves):
        across = cells << octave
        total += amplitude * _value_noise(size, across, across * stretch, seed + octave)
        weight += amplitude
        amplitude *= 0.5
    return total / weight


def _value_noise(size, across, down, seed):
    lattice = random_stream(seed).random_sample((down, across))
    x, y = np.arange(size) * across / size, np.arange(size) * down / size
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = smoothstep(0, 1, x - x0), smoothstep(0, 1, y - y0)[:, None]
    x1, y1 = (x0 + 1) % across, (y0 + 1) % down
    top = lattice[y0][:, x0] * (1 - fx) + lattice[y0][:, x1] * fx
    bottom = lattice[y1][:, x0] * (1 - fx) + lattice[y1][:, x1] * fx
    return top * (1 - fy) + bottom * fy


def courses(size, rows, columns, seed, jitter=0.0):
    """Masonry in courses, each shifted by half a stone: (distance to the nearest joint in tiles, the stone's tone).

    `jitter` varies the widths of the stones, as a share of their mean width.
    """
    random = random_stream(seed)
    position = (np.arange(size) + 0.5) / size
    row = np.floor(position * rows).astype(int)
    to_bed = np.minimum(position * rows - row, row + 1 - position * rows) / rows
    edge, tone = np.empty((size, size)), np.empty((size, size))
    for course in range(rows):
        shift = 0.5 * (course % 2)
        starts = (np.arange(columns) + shift + jitter * (random.random_sample(columns) - 0.5)) / columns
        tones = random.random_sample(columns)
        joints = np.concatenate([starts - 1, starts, starts + 1])
        stone = np.searchsorted(joints, position, side="right") - 1
        to_head = np.minimum(position - joints[stone], joints[stone + 1] - position)
        mine = row == course
        edge[mine] = np.minimum(to_head[None, :], to_bed[mine][:, None])
        tone[mine] = tones[stone % columns]
    return edge, tone


def ramp(values, *colours):
    """Colours read from an even ramp at `values` in 0..1."""
    colours = np.asarray(colours, float)
    stops = np.linspace(0, 1, len(colours))
    return np.stack([np.interp(values, stops, colours[:, c]) for c in range(3)], axis=-1)


def mix(a, b, share):
    """`a` where share is 0, `b` where it is 1."""
    return a + (b - a) * np.asarray(share)[..., None]


def normal_map(height, strength):
    """The tangent-space normal map of a height field, Y up, as glTF wants it."""
    dx = (np.roll(height, -1, axis=1) - np.roll(height, 1, axis=1)) * strength
    dy = (np.roll(height, -1, axis=0) - np.roll(height, 1, axis=0)) * strength
    normal = np.stack([-dx, dy, np.ones_like(height)], axis=-1)
    return normal / np.linalg.norm(normal, axis=-1, keepdims=True) * 0.5 + 0.5


def encode_png(image, step=4):
    """PNG bytes of an RGB or RGBA image.

    The bytes are rounded to multiples of `step`: noise in the low bits is invisible but is most of a file's size. A
    power of two keeps 128 as it is, which stands for "level" in normal maps.
    """
    pixels = np.minimum(np.round(np.clip(image, 0, 1) * 255 / step) * step, 255).astype(np.uint8)
    height, width, channels = pixels.shape
    colour_type = {3: 2, 4: 6}[channels]
    header = struct.pack(">IIBBBBB", width, height, 8, colour_type, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(_filtered(pixels), 9)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(kind, data) for kind, data in chunks)


def _chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _filtered(pixels):
    """Each row with the filter (none, left, up) whose differences are smallest: PNG's usual heuristic."""
    height, width, channels = pixels.shape
    rows = pixels.reshape(height, width * channels)
    left, up = rows.copy(), rows.copy()
    left[:, channels:] -= rows[:, :-channels]
    up[1:] -= rows[:-1]
    candidates = np.stack([rows, left, up])
    cost = np.abs(candidates.astype(np.int8).astype(int)).sum(axis=2)
    # Unfiltered rows compress well when the image has few values; differences must win clearly.
    cost[0] //= 2
    best = cost.argmin(axis=0)
    chosen = candidates[best, np.arange(height)]
    return np.column_stack([best.astype(np.uint8), chosen]).tobytes()
