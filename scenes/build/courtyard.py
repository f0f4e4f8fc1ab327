"""courtyard: a paved yard with an arcade, a fountain, a well and two lanterns, walked through in the afternoon sun.

96 frames at 24 a second. The walk begins inside the gate, pans fast from the fountain to the well at frames 33-43, and
cuts at frame 60 to a low shot that rises beside the fountain.
"""

import numpy as np

import camera
import mesh
import texture
from gltf import Scene
from mesh import box, cards, disc, join, lathe, polygon, quad, sphere, unit, wall
from texture import courses, mix, noise, normal_map, ramp, smoothstep

FRAMES = 96
CUT = 60
PAN = (33, 43)

#: The yard's inner walls stand at x = +-EAST and z = +-NORTH; north is -z.
EAST, NORTH = 10.0, 8.0
BAYS, BAY = 5, 4.0
SPRING, ARCH_TOP, ARCADE_DEPTH = 2.6, 4.6, 2.8
EAVE = 7.2


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


# ---- materials


def make_materials(scene):
    """Every material, by name."""
    return {**masonry(scene), **plaster(scene), **stone_and_clay(scene), **wood_and_metal(scene), **living(scene)}


def masonry(scene):
    """Paving and brick: stones with a tone each and joints that lie lower."""
    edge, tone = courses(512, 7, 5, seed=11, jitter=0.7)
    grain = noise(512, 8, seed=12, octaves=5)
    stone = smoothstep(0.001, 0.006, edge)
    colour = ramp(0.65 * tone + 0.35 * grain, (0.47, 0.42, 0.35), (0.63, 0.56, 0.46), (0.74, 0.66, 0.54))
    colour = mix(np.full_like(colour, 0.27) * [1.0, 0.98, 0.85], colour, stone) * (0.84 + 0.32 * grain[..., None])
    relief = 0.7 * smoothstep(0.0, 0.012, edge) + 0.35 * grain + 0.15 * tone
    # Worn stones are smoother than the joints between them.
    rough = np.stack([np.zeros_like(edge), 0.95 - 0.45 * stone * (0.5 + 0.5 * tone), np.zeros_like(edge)], axis=-1)
    paving = scene.material(
        "Paving",
        roughness=1.0,
        texture=scene.texture("paving", colour),
        normal=scene.texture("paving_normal", normal_map(relief, 6.0)),
        metallic_roughness=scene.texture("paving_roughness", rough[::2, ::2], step=8),
    )

    edge, tone = courses(512, 16, 6, seed=21, jitter=0.12)
    grain = noise(512, 16, seed=22, octaves=4)
    face = smoothstep(0.002, 0.009, edge)
    colour = ramp(0.75 * tone + 0.25 * grain, (0.50, 0.27, 0.20), (0.68, 0.40, 0.29), (0.80, 0.55, 0.40))
    colour = mix(np.ones_like(colour) * [0.66, 0.61, 0.53], colour, face) * (0.8 + 0.4 * grain[..., None])
    brick = scene.material(
        "Brick",
        roughness=0.9,
        texture=scene.texture("brick", colour),
        normal=scene.texture("brick_normal", normal_map(0.8 * smoothstep(0, 0.012, edge) + 0.3 * grain, 4.0)),
    )
    return {"paving": paving, "brick": brick}


def plaster(scene):
    """One rough plaster in three colours."""
    stains, grain = noise(256, 3, seed=31, octaves=5), noise(256, 32, seed=35, octaves=3)
    colour = ramp(stains, (0.78, 0.58, 0.33), (0.89, 0.72, 0.46), (0.94, 0.81, 0.58)) * (0.93 + 0.14 * grain[..., None])
    maps = {"texture": scene.texture("plaster", colour)}
    maps["normal"] = scene.texture("plaster_normal", normal_map(grain, 1.6))
    return {
        "plaster": scene.material("Ochre plaster", roughness=0.95, **maps),
        "pale": scene.material("Pale plaster", colour=(0.95, 1.0, 0.96), roughness=0.95, **maps),
        "rose": scene.material("Rose plaster", colour=(1.0, 0.72, 0.62), roughness=0.95, **maps),
    }


def stone_and_clay(scene):
    """Limestone, roof tiles and pots, soil, water."""
    veins = noise(256, 4, seed=41, octaves=6)
    pale = scene.texture("limestone", ramp(veins, (0.66, 0.62, 0.54), (0.84, 0.80, 0.72), (0.93, 0.90, 0.83)))
    spots = noise(256, 6, seed=51, octaves=5)
    clay = scene.texture("terracotta", ramp(spots, (0.47, 0.21, 0.13), (0.70, 0.36, 0.22), (0.83, 0.53, 0.35)))
    swell = sum(noise(256, cells, seed=60 + cells, octaves=3) / cells for cells in (4, 9))
    ripples = scene.texture("ripples_normal", normal_map(swell, 22.0))
    return {
        "limestone": scene.material("Limestone", texture=pale, roughness=0.7),
        "terracotta": scene.material("Terracotta", texture=clay, roughness=0.8),
        "tiles": scene.material("Roof tiles", colour=(1.0, 0.92, 0.9), texture=clay, roughness=0.75),
        "soil": scene.material("Soil", colour=(0.06, 0.04, 0.03), roughness=1.0),
        "water": scene.material(
            "Water", colour=(0.015, 0.05, 0.055), roughness=0.03, ior=1.33, normal=ripples, normal_scale=0.35
        ),
    }


def wood_and_metal(scene):
    """Doors, shutters, iron, brass, window glass and lamp bulbs."""
    # Four planks side by side, their fibres upright.
    fibre = np.repeat(noise(256, 24, seed=71, octaves=3)[::8], 8, axis=0)
    colour = ramp(fibre, (0.33, 0.20, 0.11), (0.51, 0.34, 0.20), (0.63, 0.45, 0.28))
    from_middle = np.abs(np.arange(256) / 64 % 1 - 0.5)
    wood = scene.texture("wood", colour * (0.35 + 0.65 * smoothstep(0.5, 0.46, from_middle))[None, :, None])
    return {
        "wood": scene.material("Wood", texture=wood, roughness=0.6),
        "green wood": scene.material("Green wood", colour=(0.35, 0.85, 0.75), texture=wood, roughness=0.45),
        "white wood": scene.material("White wood", colour=(0.85, 0.83, 0.78), roughness=0.5),
        "iron": scene.material("Iron", colour=(0.10, 0.10, 0.11), metallic=1.0, roughness=0.45),
        "brass": scene.material("Brass", colour=(0.91, 0.70, 0.36), metallic=1.0, roughness=0.15),
        "glass": scene.material("Window glass", colour=(0.03, 0.05, 0.07), roughness=0.02),
        "bulb": scene.material("Bulb", colour=(1, 0.8, 0.5), emissive=(1.0, 0.72, 0.38), strength=9.0),
    }


def living(scene):
    """Leaves cut out of a card by their alpha, in two greens, and flowers."""
    leaf = scene.texture("leaves", leaf_card(128))
    options = {"texture": leaf, "roughness": 0.6, "alpha_cutoff": 0.5, "double_sided": True}
    return {
        "leaves": scene.material("Leaves", **options),
        "dark leaves": scene.material("Dark leaves", colour=(0.5, 0.72, 0.55), **options),
        "flowers": scene.material("Flowers", colour=(0.85, 0.10, 0.16), roughness=0.6),
        "lemons": scene.material("Lemons", colour=(0.95, 0.72, 0.08), roughness=0.4),
    }


def leaf_card(size):
    """A spray of pointed leaves on a card with alpha; the green runs on under the edges so that mips stay green."""
    y, x = np.mgrid[0:size, 0:size] / size * 2 - 1
    cover, shade = np.zeros((size, size)), np.zeros((size, size))
    for i in range(9):
        angle = 2.399963 * i
        along = (x - 0.15 * np.cos(angle)) * np.cos(angle) + (y - 0.15 * np.sin(angle)) * np.sin(angle)
        across = -x * np.sin(angle) + y * np.cos(angle)
        width = 0.17 * np.sqrt(np.clip(along * (0.75 - along), 0, None)) / 0.375
        leaf = np.abs(across) < width
        cover = np.where(leaf, 1.0, cover)
        shade = np.where(leaf, 0.25 + 0.08 * i - 0.25 * (np.abs(across) < 0.015), shade)
    colour = ramp(np.where(cover > 0, shade, 0.4), (0.10, 0.22, 0.05), (0.25, 0.43, 0.11), (0.47, 0.61, 0.21))
    return np.dstack([colour, cover])


# ---- buildings


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


# ---- roofs


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


# ---- in the yard


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


# ---- sky and camera


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
