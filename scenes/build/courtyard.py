"""courtyard: a paved yard with an arcade, a fountain, a well and two lanterns, walked through in the afternoon sun.

96 frames at 24 a second. The walk begins inside the gate, pans fast from the fountain to the well at frames 33-43, and
cuts at frame 60 to a low shot that rises beside the fountain.
"""

import numpy as np

import camera
from courtyard_buildings import buildings, ground, roofs, tower
from courtyard_materials import make_materials
from courtyard_yard import fountain, furniture, greenery, lanterns, well
from gltf import Scene
from texture import mix, noise, ramp, smoothstep

FRAMES = 96
CUT = 60
PAN = (33, 43)


def build():
    """The whole scene."""
    scene = Scene("courtyard")
    materials = make_materials(scene)
    for part in (ground, buildings, roofs, tower, fountain, well, greenery, furniture, lanterns):
        part(scene, materials)
    # As large as the real one.
    scene.sun("Sun", direction=(0.55, -0.75, -0.42), watts_per_m2=3.7, colour=(1.0, 0.91, 0.78), angle=0.00925)
    move_camera(scene)
    return scene


def sky(rows):
    """An equirectangular summer sky, deep blue at the zenith and pale at the horizon, and warm ground below it.

    The columns begin towards -x and go round over -z, +x and +z, as `scene.extras.buzz.world` has it.
    """
    y, x = np.mgrid[0:rows, 0 : 2 * rows] + 0.5
    elevation, azimuth = np.pi / 2 - y / rows * np.pi, (x / rows - 1) * np.pi
    blue = ramp(np.sin(np.clip(elevation, 0, None)) ** 0.6, (0.83, 0.90, 0.96), (0.55, 0.73, 0.93), (0.27, 0.48, 0.80))
    # Clouds lie on a plane overhead that the eye sees foreshortened; the noise repeats, so any distance will do.
    reach = 140 * np.cos(elevation) / (np.sin(np.clip(elevation, 0, None)) + 0.12)
    column, row = (np.floor(reach * part).astype(int) % 512 for part in (np.cos(azimuth), np.sin(azimuth)))
    cover = smoothstep(0.50, 0.72, noise(512, 4, seed=141, octaves=6))[row, column]
    cover = 0.85 * cover * smoothstep(0.02, 0.30, elevation)
    above = mix(blue, np.full_like(blue, 0.97), cover)
    return mix(np.ones_like(above) * [0.50, 0.45, 0.38], above, smoothstep(-0.02, 0.0, elevation))


def move_camera(scene):
    """The walk with its fast pan, and after the cut the low shot."""
    walk = np.arange(CUT)
    eyes = camera.spline({0: (0.9, 1.65, 7.0), 20: (2.0, 1.7, 5.6), 40: (2.4, 1.7, 4.4), 59: (1.7, 1.62, 3.3)}, walk)
    # In degrees: a slow drift to the right, and the fast pan from the fountain to the well.
    pan = smoothstep(PAN[0], PAN[1], walk)
    heading = -14 + 0.17 * walk + 87 * pan
    pitch = 2.5 - 0.05 * walk - 1.5 * pan

    low = np.arange(FRAMES - CUT)
    low_eyes = camera.spline({0: (-4.6, 0.9, 3.4), 18: (-3.9, 1.15, 4.2), 35: (-2.9, 1.55, 4.8)}, low)
    targets = camera.spline({0: (1.2, 2.1, -3.0), 35: (1.8, 2.2, -4.0)}, low)

    scene.shots(
        [
            ("Walk", eyes, camera.quaternions(camera.look_along(heading, pitch))),
            ("Low", low_eyes, camera.quaternions(camera.look_at(low_eyes, targets))),
        ],
        yfov=np.radians(48),
        fps=24,
        resolution=(1280, 720),
        world={"strength": 1.0, "image": scene.picture("sky", sky(256), step=1)},
    )
