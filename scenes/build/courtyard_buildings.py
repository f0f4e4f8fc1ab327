"""What stands around courtyard: paving, walls, windows and doors, roofs, the bell tower."""

import numpy as np

import mesh
from mesh import box, join, lathe, polygon, quad, sphere, wall

#: The yard's inner walls stand at x = +-EAST and z = +-NORTH; north is -z.
EAST, NORTH = 10.0, 8.0
BAYS, BAY = 5, 4.0
SPRING, ARCH_TOP, ARCADE_DEPTH = 2.6, 4.6, 2.8
EAVE = 7.2


def ground(scene, materials):
    """The paving, and a plain outside the walls."""
    yard = quad((-13, 0, 9), (13, 0, 9), (13, 0, -12), (-13, 0, -12), tile=2.4)
    scene.node("Paving", mesh=scene.mesh("Paving", (yard, materials["paving"])))
    plain = quad((-80, -0.05, 80), (80, -0.05, 80), (80, -0.05, -80), (-80, -0.05, -80))
    scene.node("Plain", mesh=scene.mesh("Plain", (plain, materials["soil"])))


def column():
    """A round column with base and capital, up to the springing of the arches."""
    shaft = lathe(
        [(0.30, 0.12), (0.31, 0.18), (0.28, 0.26), (0.28, 0.26), (0.23, 0.30), (0.235, 0.9), (0.225, 1.6), (0.20, 2.2)]
        + [(0.20, 2.2), (0.23, 2.22), (0.23, 2.26), (0.20, 2.28), (0.20, 2.28), (0.22, 2.34), (0.30, 2.46)],
        24,
    )
    return join([box((-0.34, 0, -0.34), (0.34, 0.12, 0.34)), shaft, box((-0.34, 2.46, -0.34), (0.34, SPRING, 0.34))])


def buildings(scene, materials):
    """The four sides of the yard, which share their windows and doors."""
    window, door = window_mesh(scene, materials), door_mesh(scene, materials)
    north_side(scene, materials, window, door)
    other_sides(scene, materials, window, door)


def north_side(scene, materials, window, door):
    """The arcade, the range behind it with its doors and windows, and the lean-to roof's ceiling."""
    pillar = scene.mesh("Column", (column(), materials["limestone"]))
    for i in range(BAYS + 1):
        scene.node(f"Column {i}", (-EAST + BAY * i, 0, -NORTH - 0.3), mesh=pillar)
    bay = mesh.arch(3.2, BAY, SPRING, ARCH_TOP, 0.5, tile=2.0)
    arch = scene.mesh("Arch", (bay, materials["plaster"]), (moulding(1.62, 1.82), materials["limestone"]))
    for i in range(BAYS):
        scene.node(f"Arch {i}", (-EAST + BAY * (i + 0.5), 0, -NORTH - 0.05), mesh=arch)

    z = -NORTH - ARCADE_DEPTH
    doors = [(1.3 + BAY * i, 0.0, 2.7 + BAY * i, 2.3) for i in range(BAYS)]
    upper = [(1.4 + BAY * i, 5.35, 2.6 + BAY * i, 6.75) for i in range(BAYS)]
    back = wall(2 * EAST, EAVE + 0.3, doors + upper, 0.25, tile=2.0).moved((-EAST, 0, z))
    top, front = ARCH_TOP - 0.4, -NORTH - 0.5
    ceiling = quad((-EAST, top, z), (EAST, top, z), (EAST, top, front), (-EAST, top, front))
    beams = [box((x - 0.09, top - 0.22, z), (x + 0.09, top, front), skip="zY") for x in np.arange(-9.5, 9.6, 1.0)]
    scene.node("North wall", mesh=scene.mesh("North wall", (back, materials["plaster"])))
    scene.node("Ceiling", mesh=scene.mesh("Ceiling", (join([ceiling, *beams]), materials["wood"])))

    for i in range(BAYS):
        scene.node(f"Door {i}", (-EAST + BAY * (i + 0.5), 0, z - 0.2), mesh=door)
        scene.node(f"North window {i}", (-EAST + BAY * (i + 0.5), 5.35, z), mesh=window)


def moulding(inner, outer, proud=0.03, segments=24):
    """The limestone ring around an arch, between two radii, that stands out from the plaster."""
    curves = [mesh.arch_points(2 * radius, SPRING, segments) for radius in (inner, outer)]
    inside, outside = (np.column_stack([curve, np.full(segments + 1, proud)]) for curve in curves)
    return join([mesh.strip(outside, inside), mesh.strip(outside - [0, 0, 2 * proud], outside)])


def window_mesh(scene, materials):
    """A window 1.2 m by 1.4 m with panes, sill, lintel and open shutters; x centred, y from the sill, wall at z = 0."""
    pane = quad((-0.6, 0, -0.18), (0.6, 0, -0.18), (0.6, 1.4, -0.18), (-0.6, 1.4, -0.18))
    # The uprights stand a little proud: no two faces lie in one another.
    bars = [box((-0.6, y, -0.18), (0.6, y + 0.06, -0.125), skip="z") for y in (0.0, 0.46, 0.9, 1.34)]
    bars += [box((x, 0, -0.18), (x + 0.06, 1.4, -0.12), skip="z") for x in (-0.6, -0.03, 0.54)]
    trim = join([box((-0.75, -0.12, -0.1), (0.75, 0, 0.12)), box((-0.75, 1.4, -0.1), (0.75, 1.58, 0.05))])
    slats = [box((0.66, 0.02 + 0.115 * i, 0.03), (1.22, 0.10 + 0.115 * i, 0.06), 0.6, skip="z") for i in range(12)]
    shutter = join([box((0.62, 0, 0.015), (1.26, 1.4, 0.045), 0.6, skip="z"), *slats])
    shutters = join([shutter, shutter.moved((-1.88, 0, 0))])
    return scene.mesh(
        "Window",
        (pane, materials["glass"]),
        (join(bars), materials["white wood"]),
        (trim, materials["limestone"]),
        (shutters, materials["green wood"]),
    )


def door_mesh(scene, materials, width=1.4, height=2.3):
    """A panelled double door with brass knobs and a stone frame; x centred, front towards +z."""
    half = width / 2
    leaf = quad((-half, 0, 0), (half, 0, 0), (half, height, 0), (-half, height, 0), tile=1.0)
    panels = [
        box((x0, y0, 0), (x0 + half - 0.24, y1, 0.04), 1.0, skip="z")
        for x0 in (-half + 0.12, 0.12)
        for y0, y1 in ((0.18, 0.40 * height), (0.46 * height, height - 0.15))
    ]
    frame = [
        box((-half - 0.14, 0, 0.12), (-half, height + 0.14, 0.28), skip="z"),
        box((half, 0, 0.12), (half + 0.14, height + 0.14, 0.28), skip="z"),
        box((-half, height, 0.12), (half, height + 0.14, 0.28), skip="z"),
        box((-half - 0.14, 0, 0.0), (half + 0.14, 0.06, 0.5), skip="z"),
    ]
    knob = sphere(8, 12, 0.035)
    knobs = join([knob.moved((-0.07, 0.46 * height, 0.05)), knob.moved((0.07, 0.46 * height, 0.05))])
    return scene.mesh(
        "Door",
        (join([leaf, *panels]), materials["green wood"]),
        (join(frame), materials["limestone"]),
        (knobs, materials["brass"]),
    )


def other_sides(scene, materials, window, door):
    """East in brick, west in rose plaster, south a lower wall with the gate; each seen from inside the yard."""
    length = 2 * NORTH + ARCADE_DEPTH
    low = [(2.4 + 4.2 * i, 1.1, 3.6 + 4.2 * i, 2.5) for i in (0, 1, 3)]
    high = [(2.4 + 4.2 * i, 4.8, 3.6 + 4.2 * i, 6.2) for i in range(4)]
    doorway = (2.3 + 4.2 * 2, 0.0, 3.7 + 4.2 * 2, 2.3)
    for name, x, turn, material in (("East", EAST, -90, "brick"), ("West", -EAST, 90, "rose")):
        # Turned by -90 degrees a wall's x runs towards +z, by +90 towards -z: its start is at the other end.
        z, along = (-NORTH - ARCADE_DEPTH, 1) if turn < 0 else (NORTH, -1)
        face = wall(length, EAVE + 0.3, [*low, *high, doorway], 0.25, tile=1.6 if material == "brick" else 2.0)
        plinth = box((0, 0, -0.1), (doorway[0] - 0.15, 0.5, 0.08), 1.0, skip="zy")
        plinth = join([plinth, box((doorway[2] + 0.15, 0, -0.1), (length, 0.5, 0.08), 1.0, skip="zy")])
        cornice = box((0, EAVE - 0.35, -0.1), (length, EAVE - 0.1, 0.15), 1.0, skip="z")
        parts = scene.mesh(name, (face, materials[material]), (join([plinth, cornice]), materials["limestone"]))
        scene.node(f"{name} wall", (x, 0, z), turn=turn, mesh=parts)
        inward = -np.sign(x)
        for i, (x0, y0, x1, _) in enumerate(low + high):
            scene.node(f"{name} window {i}", (x, y0, z + along * (x0 + x1) / 2), turn=turn, mesh=window)
        middle = z + along * (doorway[0] + doorway[2]) / 2
        scene.node(f"{name} door", (x - 0.2 * inward, 0, middle), turn=turn, mesh=door)

    gate = (8.4, 0.0, 11.6, 3.0)
    face = wall(2 * EAST, 4.0, [gate], 0.5, tile=2.0)
    coping = box((0, 4.0, -0.6), (2 * EAST, 4.15, 0.1), 1.0)
    bars = [box((8.5 + 0.31 * i, 0, -0.3), (8.54 + 0.31 * i, 3.0, -0.26), skip="yY") for i in range(11)]
    bars += [box((8.4, y, -0.31), (11.6, y + 0.06, -0.25), skip="xX") for y in (0.15, 1.2, 2.7)]
    parts = scene.mesh(
        "South wall",
        (face, materials["pale"]),
        (coping, materials["limestone"]),
        (join(bars), materials["iron"]),
    )
    scene.node("South wall", (EAST, 0, NORTH), turn=180, mesh=parts)


def tile_column(tiles, length=0.42):
    """One column of rounded roof tiles running up a slope from the eave at the origin towards -z, 0.25 m wide."""
    angle = np.radians(np.linspace(195, -15, 7))
    arc = np.column_stack([0.11 * np.cos(angle), 0.07 * np.sin(angle)])
    pieces = []
    for i in range(tiles):
        near, far = -length * i + 0.04, -length * (i + 1)
        # The lower end of a tile lies on the one below it, and is closed as if filled with mortar.
        low = np.column_stack([arc * 1.06 + [0, 0.045], np.full(7, near)])
        high = np.column_stack([arc * 0.92 + [0, 0.005], np.full(7, far)])
        tile = join([mesh.strip(high, low, 0.9, smooth=True), polygon(low[::-1], 0.9)])
        # Every tile shows a different patch of the texture.
        tile.uvs += [0.37 * i, 0.61 * i]
        pieces.append(tile)
    bed = quad((-0.125, -0.01, 0), (0.125, -0.01, 0), (0.125, -0.01, -length * tiles), (-0.125, -0.01, -length * tiles))
    return join([*pieces, bed])


def roofs(scene, materials):
    """Tiled slopes that fall towards the yard on three sides, and the lean-to over the arcade."""
    slope = mesh.rotation_x(24)
    long = tile_column(8).transformed(slope)
    short = tile_column(6).transformed(slope)
    board = box((-0.125, -0.16, -0.45), (0.125, -0.02, -0.02), 1.0, skip="xX")
    column_mesh = scene.mesh("Tile column", (long, materials["tiles"]), (board, materials["wood"]))
    lean_to = scene.mesh("Short tile column", (short, materials["tiles"]), (board, materials["wood"]))

    def row(name, part, start, step, count, turn):
        for i in range(count):
            position = np.array(start) + np.array(step) * 0.25 * i
            scene.node(f"{name} {i}", position, turn=turn, mesh=part)

    row("Arcade roof", lean_to, (-EAST + 0.125, ARCH_TOP + 0.05, -NORTH + 0.35), (1, 0, 0), 80, 0)
    row("North roof", column_mesh, (-EAST - 1.9, EAVE, -NORTH - ARCADE_DEPTH + 0.5), (1, 0, 0), 96, 0)
    row("East roof", column_mesh, (EAST - 0.5, EAVE, NORTH), (0, 0, -1), 88, -90)
    row("West roof", column_mesh, (-EAST + 0.5, EAVE, NORTH), (0, 0, -1), 88, 90)


def tower(scene, materials):
    """A bell tower behind the north-east corner."""
    base, shaft_top, belfry_top = (6.5, -17.0), 12.5, 16.0
    shaft = box((-1.8, 0, -1.8), (1.8, shaft_top, 1.8), 2.0, skip="yY")
    band = join(box((-1.95, y, -1.95), (1.95, y + 0.25, 1.95)) for y in (9.0, shaft_top, belfry_top))
    side = mesh.arch(2.0, 3.6, shaft_top + 1.6, belfry_top, 0.5, tile=2.0).moved((0, 0, 1.8))
    pier = box((1.0, shaft_top, 1.0), (1.8, shaft_top + 1.6, 1.8), 2.0, skip="yY")
    belfry = join(part.moved(turn=turn) for part in (side, pier) for turn in (0, 90, 180, 270))
    corners = [(-2.1, 16.2, 2.1), (2.1, 16.2, 2.1), (2.1, 16.2, -2.1), (-2.1, 16.2, -2.1)]
    spire = join(polygon([corners[i], corners[(i + 1) % 4], (0, 18.6, 0)], 1.0) for i in range(4))
    bell = lathe([(0.45, 0), (0.38, 0.15), (0.3, 0.45), (0.24, 0.65), (0.0, 0.75)], 24).moved((0, 13.6, 0))
    finial = join([lathe([(0.04, 18.4), (0.04, 19.5), (0.0, 19.6)], 8), sphere(10, 16, 0.16).moved((0, 19.0, 0))])
    parts = scene.mesh(
        "Tower",
        (join([shaft, belfry]), materials["pale"]),
        (band, materials["limestone"]),
        (spire, materials["tiles"]),
        (join([bell, finial]), materials["brass"]),
    )
    scene.node("Tower", (base[0], 0, base[1]), mesh=parts)
