"""crowd: so many figures that walk over a square, under three lamps, seen from a camera that moves little.

Not committed: `scenes/speed.py` makes it to measure what bodies that move cost, by their number.
"""

import math

import numpy as np

import camera
from gltf import Scene
from mesh import lathe, quad

FRAMES, FPS = 49, 24


def build(count):
    """The scene with so many figures, in rows."""
    scene = Scene("crowd")
    stone = scene.material("Stone", colour=(0.5, 0.5, 0.5), roughness=0.9)
    cloth = scene.material("Cloth", colour=(0.7, 0.4, 0.3), roughness=0.8)
    square = quad((-60, 0, 60), (60, 0, 60), (60, 0, -60), (-60, 0, -60))
    scene.node("Square", mesh=scene.mesh("Square", (square, stone)))
    outline = [(0.35 * math.sin(angle), 0.9 - 0.9 * math.cos(angle)) for angle in np.linspace(0.02, 3.12, 13)]
    figure = scene.mesh("Figure", (lathe(outline, 24), cloth))
    for number, place in enumerate([(5, 9, -3), (-7, 8, -12), (0, 12, 6)]):
        scene.lamp(f"Lamp {number}", place, watts=900)
    move_camera(scene)
    scene.animate("Walk", FPS, walk(scene, figure, count))
    return scene


def move_camera(scene):
    """A step aside and forward in two seconds."""
    frames = np.arange(FRAMES)
    eyes = camera.spline({0: (0, 4, 3), FRAMES - 1: (1, 4.4, 2)}, frames)
    targets = camera.spline({0: (0, 1, -6), FRAMES - 1: (1, 1.4, -7)}, frames)
    scene.shots(
        [("Camera", eyes, camera.quaternions(camera.look_at(eyes, targets)))],
        yfov=np.radians(40),
        fps=FPS,
        resolution=(1280, 720),
        world={"color": [0.1, 0.1, 0.12], "strength": 1.0},
    )


def walk(scene, figure, count):
    """Each at its own pace."""
    random = np.random.RandomState(41)
    seconds = np.arange(FRAMES) / FPS
    side = math.ceil(math.sqrt(count))
    for number in range(count):
        row, column = divmod(number, side)
        pace, x = random.uniform(0.2, 0.8), 1.6 * (column - side / 2) + random.uniform(-0.3, 0.3)
        bob = 0.1 * np.abs(np.sin(7 * seconds + number))
        way = np.column_stack([x + pace * seconds, bob, np.full(FRAMES, -4 - 1.6 * row)])
        yield scene.node(f"Figure {number}", mesh=figure), "translation", way
