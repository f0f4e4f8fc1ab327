"""What stands in courtyard: fountain, well, plants, furniture, lanterns."""

import numpy as np

import mesh
import texture
from courtyard_buildings import BAY, BAYS, EAST, NORTH, tile_column
from mesh import box, cards, disc, join, lathe, sphere, unit


def fountain(scene, materials):
    """A round basin of water with a pedestal, an upper bowl that spills, and a brass finial."""
    basin = lathe(
        [(2.35, 0), (2.35, 0.14), (2.35, 0.14), (2.15, 0.14), (2.15, 0.14), (2.08, 0.2), (2.08, 0.44), (2.2, 0.5)]
        + [(2.2, 0.5), (2.2, 0.6), (2.2, 0.6), (1.8, 0.6), (1.8, 0.6), (1.8, 0.1)],
        64,
    )
    pedestal = lathe(
        [(0.42, 0.2), (0.42, 0.55), (0.42, 0.55), (0.24, 0.62), (0.18, 0.8), (0.17, 1.05), (0.24, 1.18), (0.24, 1.18)]
        + [(0.2, 1.2), (0.6, 1.3), (0.95, 1.48), (1.02, 1.58), (1.02, 1.58), (0.93, 1.58), (0.93, 1.58), (0.8, 1.46)]
        + [(0.15, 1.4), (0.15, 1.4), (0.12, 1.6), (0.16, 1.85), (0.1, 2.0), (0.0, 2.02)],
        48,
    )
    water = join([disc(1.81, 64, 0.47, tile=1.3), disc(0.9, 48, 1.545, tile=1.3)])
    ball = sphere(20, 32, 0.15).moved((0, 2.14, 0))
    parts = scene.mesh(
        "Fountain",
        (join([basin, pedestal]), materials["limestone"]),
        (water, materials["water"]),
        (ball, materials["brass"]),
    )
    scene.node("Fountain", mesh=parts)


def well(scene, materials):
    """A brick well with a windlass, a bucket and a little tiled roof, in the south-east corner."""
    wall_ring = lathe([(0.8, 0), (0.8, 0.8)], 32, tile=1.6)
    inside = lathe([(0.58, 0.8), (0.58, -0.04)], 32, tile=1.6)
    rim = lathe([(0.86, 0.8), (0.86, 0.92), (0.86, 0.92), (0.55, 0.92), (0.55, 0.92), (0.55, 0.8)], 32)
    posts = join(box((x - 0.07, 0.9, -0.07), (x + 0.07, 2.5, 0.07)) for x in (-0.75, 0.75))
    drum = lathe([(0.0, -0.68), (0.1, -0.68), (0.1, -0.68), (0.1, 0.68), (0.1, 0.68), (0.0, 0.68)], 16)
    drum = drum.transformed(mesh.rotation_z(90), (0, 1.75, 0))
    ridge = box((-0.9, 2.95, -0.05), (0.9, 3.03, 0.05))
    rope = lathe([(0.018, 1.02), (0.018, 1.7)], 8)
    rope = rope.moved((0.1, 0, 0.1))
    bucket = lathe([(0.0, 1.25), (0.13, 1.25), (0.13, 1.25), (0.17, 1.55)], 16).moved((0.1, -0.25, 0.1))
    pail = join([bucket, lathe([(0.16, 1.55), (0.12, 1.27), (0.0, 1.27)], 16).moved((0.1, -0.25, 0.1))])
    columns = [tile_column(2, length=0.5).moved((x, 0, 0)) for x in np.arange(-0.875, 0.9, 0.25)]
    boards = box((-1.0, -0.06, -1.0), (1.0, -0.02, -0.02), 1.0)
    slope, eave = mesh.rotation_x(32), (0, 2.42, 0.88)
    roof, boards = join(columns).transformed(slope, eave), boards.transformed(slope, eave)
    water = disc(0.58, 32, 0.3)
    parts = scene.mesh(
        "Well",
        (join([wall_ring, inside]), materials["brick"]),
        (rim, materials["limestone"]),
        (join([posts, drum, ridge, rope, pail, boards, boards.moved(turn=180)]), materials["wood"]),
        (join([roof, roof.moved(turn=180)]), materials["tiles"]),
        (water, materials["water"]),
    )
    scene.node("Well", (6.4, 0, 3.6), turn=25, mesh=parts)


def blob(random, count, radius, centre, size):
    """Leaf cards through the outer half of an ellipsoid."""
    direction = unit(random.normal(size=(count, 3)))
    reach = 0.55 + 0.45 * np.sqrt(random.random_sample((count, 1)))
    sizes = size * (0.75 + 0.5 * random.random_sample(count))
    surface = cards(direction * reach * radius, direction, sizes, random)
    return surface.moved(centre)


def tree(random):
    """A crown of leaves on a bent trunk: (trunk, crown)."""
    trunk = lathe([(0.2, 0), (0.13, 0.25), (0.1, 1.0), (0.085, 2.0), (0.05, 2.9)], 12)
    trunk.positions[:, 0] += 0.06 * np.sin(1.4 * trunk.positions[:, 1])
    centres = [(0, 3.1, 0), (0.55, 2.8, 0.3), (-0.5, 2.9, 0.35), (0.1, 2.75, -0.55), (-0.1, 3.6, 0.05)]
    crown = [blob(random, 210, (0.75, 0.6, 0.75), c, 0.34) for c in centres]
    return trunk, join(crown)


def pot(height=0.5, radius=0.3):
    """A terracotta pot with a rim: (pot, soil)."""
    h, r = height, radius
    shell = lathe(
        [(0.68 * r, 0), (0.95 * r, 0.8 * h), (0.95 * r, 0.8 * h), (1.07 * r, 0.8 * h), (1.07 * r, 0.8 * h)]
        + [(1.07 * r, h), (1.07 * r, h), (0.9 * r, h), (0.9 * r, h), (0.88 * r, 0.85 * h)],
        24,
    )
    return shell, disc(0.9 * r, 24, 0.88 * h)


def greenery(scene, materials):
    """Lemon trees and cypresses in pots, geraniums along the arcade, ivy on the west wall."""
    random = texture.random_stream(7)
    clay, soil = pot(0.7, 0.45)
    trunk, crown = tree(random)
    direction = unit(random.normal(size=(26, 3)) - [0, 0.4, 0])
    fruit = join(sphere(6, 8, 0.055).moved(d * [1.0, 0.8, 1.0] + [0, 2.95, 0]) for d in direction)
    lemon = scene.mesh(
        "Lemon tree",
        (clay, materials["terracotta"]),
        (soil, materials["soil"]),
        (trunk.moved((0, 0.6, 0)), materials["wood"]),
        (crown, materials["leaves"]),
        (fruit, materials["lemons"]),
    )
    for i, (x, z, turn) in enumerate([(-5.2, -4.6, 0), (5.2, -4.6, 100), (-5.4, 4.4, 200), (8.3, -1.2, 40)]):
        scene.node(f"Lemon tree {i}", (x, 0, z), turn=turn, mesh=lemon)

    cone = [blob(random, 150, (0.34 - 0.045 * k, 0.4, 0.34 - 0.045 * k), (0, 0.9 + 0.38 * k, 0), 0.2) for k in range(6)]
    cypress = scene.mesh(
        "Cypress",
        (clay, materials["terracotta"]),
        (soil, materials["soil"]),
        (join(cone), materials["dark leaves"]),
    )
    for i, (x, z) in enumerate([(-2.4, 7.2), (2.4, 7.2), (-9.2, 0.4), (9.3, -6.9), (-9.2, -6.9)]):
        scene.node(f"Cypress {i}", (x, 0, z), turn=70 * i, mesh=cypress)

    small, small_soil = pot(0.36, 0.24)
    bush = blob(random, 90, (0.32, 0.22, 0.32), (0, 0.5, 0), 0.17)
    heads = unit(random.normal(size=(22, 3)) + [0, 0.9, 0]) * [0.34, 0.25, 0.34] + [0, 0.52, 0]
    bloom = join(sphere(5, 7, 0.045).moved(h) for h in heads)
    geranium = scene.mesh(
        "Geranium",
        (small, materials["terracotta"]),
        (small_soil, materials["soil"]),
        (bush, materials["leaves"]),
        (bloom, materials["flowers"]),
    )
    places = [(-EAST + BAY * (i + 0.5) + s * 1.15, -NORTH - 0.1) for i in range(BAYS) for s in (-1, 1)]
    places += [(4.9, 4.6), (7.6, 2.5), (7.9, 4.4), (-9.4, 3.2), (-9.4, 5.6), (9.4, -4.4)]
    for i, (x, z) in enumerate(places):
        scene.node(f"Geranium {i}", (x, 0, z), turn=50 * i, mesh=geranium)

    scene.node("Ivy", mesh=scene.mesh("Ivy", (ivy(random), materials["dark leaves"])))


def ivy(random, count=1500):
    """Leaf cards that climb the west wall from the ground, thinning out towards the top and the sides."""
    height = 6.3 * random.random_sample(count) ** 1.5
    spread = 1.1 + 0.25 * np.sin(2.1 * height) + 0.12 * height
    z = -4.6 + spread * random.uniform(-1, 1, count) * random.random_sample(count) ** 0.3
    centres = np.column_stack([-EAST + 0.06 + 0.1 * random.random_sample(count), height, z])
    normals = unit(np.array([1.0, 0.25, 0]) + 0.25 * random.normal(size=(count, 3)))
    return cards(centres, normals, np.full(count, 0.26), random)


def furniture(scene, materials):
    """Benches by the fountain, barrels and crates by the east door."""
    slats = [box((-0.9, 0.42, z), (0.9, 0.47, z + 0.12), 1.0) for z in (-0.22, -0.06, 0.10)]
    legs = [box((x, 0, -0.2), (x + 0.1, 0.42, 0.2), skip="y") for x in (-0.75, 0.65)]
    bench = scene.mesh("Bench", (join(slats), materials["wood"]), (join(legs), materials["limestone"]))
    for i, (x, z, turn) in enumerate([(-3.6, 0, 90), (3.6, 0.4, -90), (0, -3.7, 0)]):
        scene.node(f"Bench {i}", (x, 0, z), turn=turn, mesh=bench)

    staves = lathe([(0.24, 0), (0.31, 0.25), (0.33, 0.45), (0.31, 0.65), (0.24, 0.9)], 24)
    lid = disc(0.24, 24, 0.895)
    hoops = join(
        lathe([(r, y), (r, y + 0.05)], 24) for r, y in ((0.29, 0.12), (0.334, 0.34), (0.334, 0.52), (0.29, 0.73))
    )
    barrel = scene.mesh("Barrel", (join([staves, lid]), materials["wood"]), (hoops, materials["iron"]))
    for i, (x, z) in enumerate([(9.2, 4.6), (9.3, 5.4), (8.6, 5.1)]):
        scene.node(f"Barrel {i}", (x, 0, z), turn=40 * i, mesh=barrel)

    planks = [box((-0.35, 0.14 * i, -0.3), (0.35, 0.14 * i + 0.12, 0.3), 0.8) for i in range(4)]
    crate = scene.mesh("Crate", (join(planks), materials["wood"]))
    for i, (x, y, z, turn) in enumerate([(9.0, 0, 6.6, 8), (8.2, 0, 6.8, -14), (8.9, 0.55, 6.7, 30)]):
        scene.node(f"Crate {i}", (x, y, z), turn=turn, mesh=crate)


def lanterns(scene, materials):
    """Two wall lanterns with a lamp in each, on the arcade's columns.

    The light hangs just under the bulb, which would otherwise shade everything.
    """
    bars = [
        box((x - 0.012, -0.2, z - 0.012), (x + 0.012, 0.2, z + 0.012)) for x in (-0.13, 0.13) for z in (-0.13, 0.13)
    ]
    cap = lathe(
        [(0.0, 0.2), (0.24, 0.2), (0.24, 0.2), (0.2, 0.24), (0.08, 0.36), (0.03, 0.4), (0.03, 0.46), (0.0, 0.48)], 4
    )
    rim = join(
        [
            box((-0.15, -0.22, 0.11), (0.15, -0.2, 0.15)),
            box((-0.15, -0.22, -0.15), (0.15, -0.2, -0.11)),
            box((-0.15, -0.22, -0.11), (-0.11, -0.2, 0.11)),
            box((0.11, -0.22, -0.11), (0.15, -0.2, 0.11)),
        ]
    )
    bracket = box((-0.02, 0.4, -0.5), (0.02, 0.44, 0.05))
    iron = join([*bars, cap.moved(turn=45), rim, bracket])
    bulb = sphere(10, 14, 1.0).moved((0, 0.12, 0), scale=(0.06, 0.09, 0.06))
    lantern = scene.mesh("Lantern", (iron, materials["iron"]), (bulb, materials["bulb"]))
    for name, x in (("west", -2.0), ("east", 6.0)):
        place = np.array([x, 2.9, -NORTH + 0.42])
        scene.node(f"Lantern {name}", place, mesh=lantern)
        scene.lamp(f"Lamp {name}", place + [0, -0.02, 0], watts=60, colour=(1.0, 0.68, 0.36), radius=0.04)
