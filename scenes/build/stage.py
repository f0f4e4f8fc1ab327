"""stage: a theatre's stage on which everything moves that inference has to follow.

96 frames at 24 a second: a carousel turns, a cart with wheels rolls through, a banner with bones sways, a balloon is
morphed, a lantern swings with its light, and a spot changes colour, strength and cone. The set and two lamps stand
still, and the camera is pushed past it all.
"""

import itertools

import numpy as np

import camera
import mesh
from gltf import Scene
from mesh import Surface, box, join, lathe, quad, sphere, unit
from texture import courses, mix, noise, normal_map, ramp, smoothstep

FRAMES, FPS = 96, 24

#: The stage: x = +-WIDE, z = BACK to FRONT, y = 0 to HIGH.
WIDE, BACK, FRONT, HIGH = 5.0, -4.0, 3.0, 4.5

#: Bones of the banner, and its height.
BONES, BANNER = 4, 2.4


def build():
    """The whole scene."""
    scene = Scene("stage")
    materials = make_materials(scene)
    stand_set(scene, materials)
    lights(scene)
    move_camera(scene)
    parts = (carousel, cart, banner, balloon, lantern, coloured_spot)
    scene.animate("Play", FPS, itertools.chain.from_iterable(part(scene, materials) for part in parts))
    return scene


# ---- what stands still


def make_materials(scene):
    """Every material by name."""
    edge, tone = courses(256, 8, 2, seed=31, jitter=0.5)
    fibre = noise(256, 4, seed=32, octaves=4, stretch=16)
    board = smoothstep(0.0005, 0.004, edge)
    wood = ramp(0.6 * tone + 0.4 * fibre, (0.26, 0.15, 0.09), (0.42, 0.26, 0.15), (0.60, 0.40, 0.25))
    planks = mix(0.3 * wood, wood, board)
    return {
        "planks": scene.material(
            "Planks",
            roughness=0.6,
            texture=scene.texture("planks", planks),
            normal=scene.texture("planks_normal", normal_map(0.4 * board + 0.05 * fibre, 1.0)),
        ),
        "curtain": scene.material("Curtain", colour=(0.45, 0.05, 0.07), roughness=0.9),
        "wood": scene.material("Wood", colour=(0.50, 0.36, 0.22), roughness=0.6),
        "white": scene.material("White", colour=(0.82, 0.80, 0.76), roughness=0.7),
        "blue": scene.material("Blue", colour=(0.10, 0.24, 0.55), roughness=0.5),
        "gold": scene.material("Gold", colour=(0.90, 0.66, 0.25), metallic=1.0, roughness=0.4),
        "cloth": scene.material("Cloth", colour=(0.15, 0.45, 0.30), roughness=0.9, double_sided=True),
        "rubber": scene.material("Rubber", colour=(0.75, 0.20, 0.35), roughness=0.4),
        "iron": scene.material("Iron", colour=(0.06, 0.06, 0.07), roughness=0.6),
    }


def stand_set(scene, materials):
    """Boards, a curtain in folds, two flats, steps, columns and a table."""
    floor = quad((-WIDE, 0, FRONT), (WIDE, 0, FRONT), (WIDE, 0, BACK), (-WIDE, 0, BACK), 2.0)
    x = np.linspace(-WIDE, WIDE, 161)
    folds = np.column_stack([x, np.zeros_like(x), BACK + 0.3 + 0.12 * np.sin(6.0 * x)])
    curtain = mesh.strip(folds + [0, HIGH, 0], folds, smooth=True)
    flats = join(
        box((s * 4.2 - 0.06, 0, z - 0.6), (s * 4.2 + 0.06, 3.4, z + 0.6)) for s in (-1, 1) for z in (-2.4, -0.2)
    )
    steps = join(box((2.2, 0, -3.2 + 0.35 * i), (3.9, 0.6 - 0.2 * i, -2.85 + 0.35 * i)) for i in range(3))
    profile = [(0.26, 0), (0.26, 0.12), (0.26, 0.12), (0.17, 0.18), (0.15, 2.1), (0.24, 2.2), (0.24, 2.2), (0.24, 2.3)]
    columns = join(lathe(profile, 32).moved((s * 3.3, 0, BACK + 1.0)) for s in (-1, 1))
    legs = [box((x, 0, z), (x + 0.06, 0.72, z + 0.06), skip="yY") for x in (-0.5, 0.44) for z in (-0.3, 0.24)]
    table = join([box((-0.55, 0.72, -0.35), (0.55, 0.78, 0.35)), *legs]).moved((2.3, 0, 0.6), turn=20)
    vase = lathe([(0.07, 0.78), (0.13, 0.95), (0.05, 1.15), (0.09, 1.25)], 32).moved((2.3, 0, 0.6))
    parts = [(floor, "planks"), (curtain, "curtain"), (flats, "white"), (steps, "wood"), (columns, "gold")]
    parts += [(table, "wood"), (vase, "blue")]
    scene.node("Set", mesh=scene.mesh("Set", *((surface, materials[name]) for surface, name in parts)))


def lights(scene):
    """Two spots from the front."""
    for name, x, colour in (("left", -3.5, (1.0, 0.92, 0.80)), ("right", 3.8, (0.85, 0.92, 1.0))):
        place = np.array([x, 4.2, 4.5])
        direction = unit(np.array([-0.2 * x, 0.6, -1.5]) - place)
        scene.spot(f"Lamp {name}", place, direction, watts=900, cone=(24, 38), colour=colour)


def move_camera(scene):
    """From the left of the house towards the middle of the stage."""
    frames = np.arange(FRAMES)
    eyes = camera.spline({0: (-2.4, 1.5, 7.2), 48: (-0.9, 1.7, 6.2), 95: (0.9, 1.6, 5.4)}, frames)
    targets = camera.spline({0: (-0.3, 1.1, -1.0), 95: (0.3, 1.1, -1.4)}, frames)
    scene.shots(
        [("Camera", eyes, camera.quaternions(camera.look_at(eyes, targets)))],
        yfov=np.radians(42),
        fps=FPS,
        resolution=(1280, 720),
        world={"color": [0.10, 0.10, 0.12], "strength": 1.0},
    )


# ---- what moves


def turned(degrees, axis):
    """Quaternions of turns about an axis."""
    half = np.radians(np.asarray(degrees, float))[:, None] / 2
    return np.column_stack([np.sin(half) * np.asarray(axis, float), np.cos(half)])


def carousel(scene, materials):
    """A disc with four riders, under a roof on a pole; it turns about a third of the way round."""
    base = lathe([(1.0, 0.0), (1.05, 0.12), (1.05, 0.12), (0.0, 0.12)], 48)
    pole = lathe([(0.05, 0.12), (0.05, 1.9)], 16)
    roof = lathe([(1.05, 1.65), (0.0, 2.05)], 8)
    rider = join([box((-0.22, 0.45, -0.08), (0.2, 0.68, 0.08)), box((0.14, 0.6, -0.06), (0.3, 0.92, 0.06))])
    riders = join(rider.moved((0, 0, 0.72)).moved(turn=turn) for turn in range(0, 360, 90))
    poles = join(
        lathe([(0.02, 0.12), (0.02, 1.68)], 8).moved((0, 0, 0.72)).moved(turn=turn) for turn in range(0, 360, 90)
    )
    parts = [(base, "wood"), (join([pole, poles]), "gold"), (roof, "blue"), (riders, "white")]
    part = scene.mesh("Carousel", *((surface, materials[name]) for surface, name in parts))
    node = scene.node("Carousel", (-1.7, 0, -1.3), mesh=part)
    return [(node, "rotation", turned(np.linspace(0, 130, FRAMES), (0, 1, 0)))]


def cart(scene, materials):
    """A cart that rolls along the front of the stage on four wheels."""
    body = join([box((-0.45, 0.22, -0.25), (0.45, 0.30, 0.25)), box((-0.4, 0.30, -0.2), (0.1, 0.62, 0.2))])
    node = scene.node("Cart", mesh=scene.mesh("Cart", (body, materials["rubber"])))
    wheel = lathe([(0.03, -0.03), (0.14, -0.03), (0.14, -0.03), (0.14, 0.03), (0.14, 0.03), (0.03, 0.03)], 24)
    spokes = [box((-0.12, -0.02, -0.015), (0.12, 0.02, 0.015)), box((-0.015, -0.02, -0.12), (0.015, 0.02, 0.12))]
    part = scene.mesh("Wheel", (join([wheel, *spokes]).transformed(mesh.rotation_x(90)), materials["iron"]))
    way = 3.2 * smoothstep(0.0, 1.0, np.linspace(0, 1, FRAMES)) - 1.2
    tracks = [(node, "translation", np.column_stack([way, 0 * way, 0 * way + 1.3]))]
    for i, (x, z) in enumerate(itertools.product((-0.3, 0.3), (-0.3, 0.3))):
        rolled = turned(-np.degrees(way / 0.14), (0, 0, 1))
        tracks.append((scene.node(f"Wheel {i}", (x, 0.14, z), parent=node, mesh=part), "rotation", rolled))
    return tracks


def banner(scene, materials):
    """A cloth between two columns that hangs from a rod and sways on a chain of bones."""
    columns, rows = 12, 24
    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1), indexing="ij")
    positions = np.column_stack([0.9 * (u.ravel() - 0.5), -BANNER * v.ravel(), 0 * u.ravel()])
    cloth = Surface(
        positions,
        np.tile([0.0, 0.0, 1.0], (len(positions), 1)),
        np.column_stack([u.ravel(), v.ravel()]),
        mesh.grid_triangles(columns, rows),
    )
    part = scene.mesh("Banner", (cloth, materials["cloth"]))
    step, nodes, parent = BANNER / BONES, [], None
    for i in range(BONES):
        place = (0.9, 3.3, -2.6) if parent is None else (0, -step, 0)
        parent = scene.node(f"Bone {i}", place, parent=parent)
        nodes.append(parent)
    binds = np.tile(np.eye(4), (BONES, 1, 1))
    binds[:, 1, 3] = step * np.arange(BONES)
    # Each vertex hangs between the two bones around it.
    at = np.clip(v.ravel() * BONES - 0.5, 0, BONES - 1)
    low = np.minimum(np.floor(at), BONES - 2)
    zeros = 0 * at
    indices = np.column_stack([low, low + 1, zeros, zeros])
    weights = np.column_stack([1 - (at - low), at - low, zeros, zeros])
    skin = scene.skin(part, nodes, binds, indices, weights)
    scene.node("Banner", mesh=part, skin=skin)
    time = np.arange(FRAMES) / FPS
    sway = [(8 + 4 * i) * np.sin(2 * np.pi * 0.45 * time - 0.8 * i) for i in range(BONES)]
    return [(node, "rotation", turned(degrees, (1, 0, 0))) for node, degrees in zip(nodes, sway, strict=True)]


def balloon(scene, materials):
    """A ball on the steps that swells to one side and the other."""
    ball = sphere(24, 48, 0.34)
    flat = ball.moved(scale=(1.35, 0.7, 1.2))
    tall = ball.moved(scale=(0.8, 1.3, 0.85))
    part = scene.mesh("Balloon", (ball, materials["rubber"]))
    scene.morph(part, flat, tall)
    node = scene.node("Balloon", (2.9, 1.05, -3.0), mesh=part)
    beat = np.sin(2 * np.pi * 0.6 * np.arange(FRAMES) / FPS)
    weights = np.column_stack([np.maximum(beat, 0), np.maximum(-beat, 0)])
    return [(node, "weights", weights)]


def lantern(scene, materials):
    """A lantern on a rod that swings, with a light under it."""
    rod = box((-0.01, -1.3, -0.01), (0.01, 0, 0.01))
    cap = lathe([(0.16, -1.36), (0.05, -1.26), (0.0, -1.24)], 16)
    pivot = scene.node("Lantern", (0.4, 4.1, -0.4), mesh=scene.mesh("Lantern", (join([rod, cap]), materials["iron"])))
    scene.lamp("Lantern light", (0, -1.45, 0), watts=120, colour=(1.0, 0.70, 0.40), parent=pivot)
    swing = 22 * np.sin(2 * np.pi * 0.35 * np.arange(FRAMES) / FPS)
    return [(pivot, "rotation", turned(swing, (0, 0, 1)))]


def coloured_spot(scene, materials):
    """A spot on the curtain that changes its colour, its strength and its cone, and is out for a while."""
    place = np.array([-0.5, 4.3, 1.5])
    scene.spot("Coloured spot", place, unit(np.array([-0.8, 0.8, BACK]) - place), watts=500, cone=(12, 20))
    light = len(scene.lights) - 1
    share = np.linspace(0, 1, FRAMES)
    colour = mix(np.tile([0.9, 0.3, 0.2], (FRAMES, 1)), np.tile([0.2, 0.4, 1.0], (FRAMES, 1)), share)
    strength = scene.lights[light]["intensity"] * np.maximum(np.cos(2 * np.pi * share), 0)
    cone = np.radians(18 + 8 * np.sin(2 * np.pi * share))
    pointer = f"/extensions/KHR_lights_punctual/lights/{light}"
    return [
        (None, f"{pointer}/color", colour),
        (None, f"{pointer}/intensity", strength),
        (None, f"{pointer}/spot/outerConeAngle", cone),
    ]
