"""buzz-city: the setting of the paper that Buzz implements, modelled anew.

Adelson and Hodges tested their algorithm on 600 frames at 640x480 of a city and a yellowjacket: 755 polygons and 41
quadrics under one light, 578 of the polygons and all the quadrics partly reflective, four quadrics also refractive,
frames 0-24 of nothing but ground and sky, a camera that turns about all three axes. Their model is lost; this one has
the same counts (`check` asserts them), so that ray counts can be put beside their tables.

The sky is a polygon too, and must not come between the light and the city. It leans: at 45 degrees it rises from the
ground far ahead, over the city, to high behind the camera. The sun stands behind the camera, lower than that, and so
shines in under it. The sky is unlit: it receives no shadow and no highlight, as in the paper.

A polygon is one flat face, whatever number of triangles glTF makes of it; a quadric is a true one, with a mesh beside
it for readers that know none. Each building and each quadric is a node, so that it has an object tag of its own;
`extras` on the node give its polygons, and whether it reflects and refracts.
"""

from dataclasses import dataclass

import numpy as np

import camera
from gltf import Scene
from mesh import join, polygon, rotation_x, rotation_y, rotation_z, sphere
from texture import mix, noise, ramp, random_stream, smoothstep

FRAMES = 600
RESOLUTION = (640, 480)
YFOV = np.radians(50)

POLYGONS, REFLECTIVE_POLYGONS = 755, 578
QUADRICS, REFRACTIVE_QUADRICS = 41, 4

#: The plan: 11 by 11 plots, 17 m apart, without those of the plaza where the yellowjacket hovers.
PITCH, PLOTS = 17.0, 11
CORNER = np.array([-75.0, -115.0])
PLAZA = np.array([10.0, 4.0])
BUZZ = np.array([10.0, 13.0, 4.0])

#: Buildings of each kind; the towers are what reflects.
TOWERS = {"stepped": 10, "hexagonal": 10, "octagonal": 8, "pyramid": 12, "box": 24, "wedge": 14}
HOUSES = 30

#: Towards the sun.
SUN = np.array([0.42, 0.52, 0.75])
#: How far ahead the sky meets the ground, and half the width of both. Larger would cost single precision its
#: millimetres.
HORIZON, HALF_WIDTH = 1500.0, 6000.0


@dataclass
class Solid:
    """A node to be: its faces (lists of corners) and how it looks."""

    name: str
    faces: list
    material: str


@dataclass
class Ellipsoid:
    """A quadric: semi-axes, orientation (world from object) and centre."""

    name: str
    axes: tuple
    rotation: np.ndarray
    centre: np.ndarray
    material: str


def build():
    """The whole scene."""
    scene = Scene("buzz-city")
    materials = make_materials(scene)
    solids, quadrics = model()
    check(solids, quadrics)
    for solid in solids:
        surface = join(textured(face, solid.material) for face in solid.faces)
        extras = {"polygons": len(solid.faces), "reflective": solid.material in GLASS}
        mesh = scene.mesh(solid.name, (surface, materials[solid.material]))
        scene.node(solid.name, mesh=mesh, extras=extras)
    ball = sphere(40, 80)
    balls = {}
    unit_sphere = scene.shape({"type": "sphere", "sphere": {"radius": 1.0}})
    for quadric in quadrics:
        if quadric.material not in balls:
            balls[quadric.material] = scene.mesh(quadric.material, (ball, materials[quadric.material]))
        (rotation,) = camera.quaternions([quadric.rotation])
        extras = {"quadric": True, "reflective": True, "refractive": quadric.material == "wing"}
        scene.node(
            quadric.name,
            quadric.centre,
            rotation=rotation,
            scale=quadric.axes,
            mesh=balls[quadric.material],
            extensions=scene.shape_binding(unit_sphere, materials[quadric.material]),
            extras=extras,
        )
    scene.sun("Sun", direction=-SUN, watts_per_m2=3.3, colour=(1.0, 0.95, 0.86))
    positions, rotations = camera_path()
    scene.shots(
        [("Camera", positions, camera.quaternions(rotations))],
        yfov=YFOV,
        fps=24,
        resolution=RESOLUTION,
        world={"color": [0.30, 0.45, 0.68], "strength": 1.0},
    )
    return scene


def textured(face, material):
    """A face with its texture: the ground's has a plot in its middle, flat roofs show no windows but its corner."""
    surface = polygon(face, TILES.get(material, 1.0))
    if material == "ground":
        surface.uvs -= CORNER / PITCH - 0.5
    if material in (*GLASS, *PLASTER) and surface.normals[0, 1] > 0.99:
        surface.uvs = np.zeros_like(surface.uvs)
    return surface


def model():
    """Everything that can be seen: (solids with flat faces, quadrics)."""
    return [ground(), sky(), *buildings(), *lawns()], [*yellowjacket(), *balls_on_plaza()]


def check(solids, quadrics):
    """The paper's counts."""
    assert sum(len(s.faces) for s in solids) == POLYGONS
    assert sum(len(s.faces) for s in solids if s.material in GLASS) == REFLECTIVE_POLYGONS
    assert len(quadrics) == QUADRICS
    assert sum(q.material == "wing" for q in quadrics) == REFRACTIVE_QUADRICS


# ---- materials

#: Materials of the towers, all partly reflective; the share that is a mirror is their metallic factor.
GLASS = {
    "blue glass": dict(colour=(0.36, 0.52, 0.70), metallic=0.28),
    "green glass": dict(colour=(0.38, 0.60, 0.52), metallic=0.22),
    "bronze glass": dict(colour=(0.72, 0.52, 0.34), metallic=0.25),
    "white stone": dict(colour=(0.86, 0.84, 0.80), metallic=0.0),
    "red granite": dict(colour=(0.62, 0.30, 0.26), metallic=0.0),
}

#: Colours of the houses, which are diffuse.
PLASTER = {"cream": (0.83, 0.76, 0.60), "rose": (0.80, 0.55, 0.46), "grey": (0.62, 0.64, 0.66)}

#: Width in metres that one repeat of a material's texture covers.
TILES = {"ground": PITCH, "sky": 6000.0, **dict.fromkeys([*GLASS, *PLASTER], 3.0)}


def make_materials(scene):
    """Every material, by name."""
    floors = scene.texture("floors", facade(64))
    towers = {name: scene.material(name, roughness=0.04, texture=floors, **look) for name, look in GLASS.items()}
    houses = {name: scene.material(name, colour, roughness=0.9, texture=floors) for name, colour in PLASTER.items()}
    return {
        **towers,
        **houses,
        "ground": scene.material("ground", roughness=0.4, texture=scene.texture("plots", plot(256))),
        "sky": scene.material("sky", unlit=True, texture=scene.texture("sky", clouds(256))),
        "lawn": scene.material("lawn", colour=(0.16, 0.34, 0.10), roughness=0.9),
        "yellow": scene.material("yellow", colour=(0.95, 0.66, 0.04), roughness=0.1),
        "black": scene.material("black", colour=(0.02, 0.02, 0.025), roughness=0.05),
        "white": scene.material("white", colour=(0.9, 0.9, 0.9), roughness=0.1),
        "chrome": scene.material("chrome", colour=(0.9, 0.9, 0.92), metallic=1.0, roughness=0.02),
        "wing": scene.material(
            "wing",
            colour=(0.90, 0.95, 1.0),
            roughness=0.0,
            ior=1.3,
            transmission=0.9,
            attenuation=((0.75, 0.88, 1.0), 1.0),
        ),
    }


def facade(size):
    """Three storeys of three windows: panes in the tower's own colour between paler bands."""
    y, x = np.mgrid[0:size, 0:size] / size * 3 % 1
    pane = smoothstep(0.06, 0.12, np.minimum(x, 1 - x)) * smoothstep(0.14, 0.2, np.minimum(y, 1 - y))
    return mix(np.full((size, size, 3), 1.0), np.full((size, size, 3), 0.62), pane)


def plot(size):
    """One plot of the town seen from above: a pavement with streets around it."""
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size - 0.5
    # From the middle of the street, in plots: streets run along the edges.
    to_street = 0.5 - np.maximum(np.abs(x), np.abs(y))
    grain = noise(size, 16, seed=1, octaves=4)
    asphalt = ramp(grain, (0.30, 0.30, 0.31), (0.40, 0.40, 0.41))
    flags = ramp(grain, (0.58, 0.56, 0.52), (0.70, 0.68, 0.63))
    joint = np.minimum(np.abs((x * 17) % 1 - 0.5), np.abs((y * 17) % 1 - 0.5))
    flags = flags * (1 - 0.12 * smoothstep(0.06, 0.02, joint))[..., None]
    along = np.where(np.abs(x) > np.abs(y), y, x)
    dash = (to_street < 0.008) & (np.abs((along * 6) % 1 - 0.5) < 0.25)
    colour = mix(asphalt, flags, smoothstep(0.135, 0.14, to_street))
    return np.where(dash[..., None], 0.85, colour)


def clouds(size):
    """A summer sky with soft clouds."""
    cover = smoothstep(0.48, 0.78, noise(size, 5, seed=5, octaves=6))
    return mix(np.full((size, size, 3), 1.0) * [0.50, 0.68, 0.90], np.full((size, size, 3), 0.97), 0.8 * cover)


# ---- ground, sky, town


def ground():
    """A plain that reaches to where the sky begins."""
    w, far, near = HALF_WIDTH, -HORIZON, HORIZON
    return Solid("Ground", [[(-w, 0, near), (w, 0, near), (w, 0, far), (-w, 0, far)]], "ground")


def sky():
    """A lid that leans over everything at 45 degrees."""
    w, far, near = HALF_WIDTH, -HORIZON, HORIZON
    corners = [(w, 0, far), (-w, 0, far), (-w, near - far, near), (w, near - far, near)]
    return Solid("Sky", [corners[::-1]], "sky")


def prism(x, z, radius, low, high, sides, turn):
    """The sides and the roof of an upright prism with corners at `radius`."""
    angle = np.radians(turn) + np.arange(sides) * 2 * np.pi / sides
    ring = np.column_stack([x + radius * np.sin(angle), z + radius * np.cos(angle)])
    bottom = [(a, low, b) for a, b in ring]
    top = [(a, high, b) for a, b in ring]
    around = [[bottom[i - 1], bottom[i], top[i], top[i - 1]] for i in range(sides)]
    return [*around, top]


def square(x, z, half, low, high):
    """The sides and the roof of an upright box."""
    return prism(x, z, half * np.sqrt(2), low, high, 4, 45)


def stepped(x, z, half, height):
    """Three boxes, each smaller than the one it stands on."""
    steps = zip((1.0, 0.75, 0.5), (0.0, 0.5, 0.8), (0.5, 0.8, 1.0), strict=True)
    return [face for share, low, high in steps for face in square(x, z, half * share, low * height, high * height)]


def pyramid(x, z, half, height):
    """A box with a pyramid for a roof."""
    *walls, roof = square(x, z, half, 0, 0.8 * height)
    return [*walls, *([roof[i - 1], roof[i], (x, height, z)] for i in range(4))]


def wedge(x, z, half, height):
    """A box whose roof slopes."""
    faces = square(x, z, half, 0, height)
    return [[(a, b if b == 0 or a > x else 0.7 * height, c) for a, b, c in face] for face in faces]


def tower(shape, x, z, half, height):
    """The faces of a tower; their number depends on its shape."""
    if shape == "stepped":
        return stepped(x, z, half, height)
    if shape == "hexagonal":
        return prism(x, z, 1.1 * half, 0, height, 6, 0)
    if shape == "octagonal":
        return prism(x, z, 1.05 * half, 0, height, 8, 22.5)
    if shape == "pyramid":
        return pyramid(x, z, half, height)
    if shape == "wedge":
        return wedge(x, z, half, height)
    return square(x, z, half, 0, height)


def plots():
    """The plots to build on, those nearest to the camera's way first."""
    i, j = np.meshgrid(np.arange(PLOTS), np.arange(PLOTS), indexing="ij")
    centres = CORNER + PITCH * np.column_stack([i.ravel(), j.ravel()])
    built = centres[np.abs(centres - PLAZA).max(axis=1) > 1.2 * PITCH]
    way = camera_path()[0][::10, [0, 2]]
    distance = np.linalg.norm(built[:, None] - way, axis=-1).min(axis=1)
    return built[np.argsort(distance, kind="stable")]


def buildings():
    """Houses under the camera's way, towers elsewhere, higher towards the back."""
    random = random_stream(3)
    shapes = [shape for shape, count in TOWERS.items() for _ in range(count)]
    random.shuffle(shapes)
    places = plots()
    # The plots nearest of all stay empty.
    places = places[len(places) - HOUSES - len(shapes) :]
    solids = []
    for n, (x, z) in enumerate(places[:HOUSES]):
        height = 3.5 + 4.0 * random.random_sample()
        faces = square(x, z, 4.0 + random.random_sample(), 0, height)
        solids.append(Solid(f"House {n}", faces, list(PLASTER)[n % len(PLASTER)]))
    for n, ((x, z), shape) in enumerate(zip(places[HOUSES:], shapes, strict=True)):
        back = (60 - z) / 175
        height = 10 + 23 * back + 15 * random.random_sample() ** 2
        faces = tower(shape, x, z, 4.4 + 1.2 * random.random_sample(), height)
        solids.append(Solid(f"Tower {n} {shape}", faces, list(GLASS)[random.randint(len(GLASS))]))
    return solids


def lawns():
    """Lawns on the nine plots of the plaza: one large in the middle, four small on each plot at either side."""
    plots = [PLAZA + PITCH * np.array([i, j]) for i in (-1, 1) for j in (-1, 0, 1)]
    beds = [(PLAZA, 5.6), *((plot + 3 * np.array([a, b]), 2.6) for plot in plots for a in (-1, 1) for b in (-1, 1))]
    y = 0.04
    return [
        Solid(f"Lawn {n}", [[(x - h, y, z + h), (x + h, y, z + h), (x + h, y, z - h), (x - h, y, z - h)]], "lawn")
        for n, ((x, z), h) in enumerate(beds)
    ]


# ---- quadrics


def yellowjacket():
    """The insect, 39 ellipsoids: it looks towards +z, its wings refract."""
    level = np.eye(3)
    parts = [
        ("head", (1.25, 1.15, 1.1), level, (0, 0.7, 4.3), "yellow"),
        ("thorax", (1.45, 1.4, 1.9), level, (0, 0.4, 2.0), "black"),
        ("collar", (1.3, 1.25, 0.45), level, (0, 0.55, 3.35), "yellow"),
        ("sting", (0.14, 0.14, 0.9), rotation_x(25), (0, -2.3, -6.6), "black"),
    ]
    # The abdomen hangs: five rings, yellow and black in turn.
    rings = [(1.1, 0.3, 0.1), (1.55, 0.05, -1.2), (1.6, -0.4, -2.5), (1.35, -0.95, -3.8), (0.9, -1.6, -5.1)]
    for n, (radius, y, z) in enumerate(rings):
        axes = (radius, radius, 1.15)
        parts.append((f"abdomen {n}", axes, rotation_x(-20), (0, y, z), "black" if n % 2 else "yellow"))
    for side, s in (("left", 1), ("right", -1)):
        parts += [
            (f"{side} eye", (0.5, 0.62, 0.42), rotation_y(30 * s), (0.62 * s, 1.1, 5.0), "white"),
            (f"{side} pupil", (0.22, 0.3, 0.16), rotation_y(30 * s), (0.76 * s, 1.1, 5.38), "black"),
            (f"{side} feeler", (0.08, 0.95, 0.08), rotation_x(35) @ rotation_z(-25 * s), (0.8 * s, 2.4, 4.9), "black"),
            (f"{side} feeler tip", (0.2, 0.2, 0.2), level, (1.2 * s, 3.15, 5.45), "yellow"),
        ]
        for pair, (z, sweep, length) in enumerate(((2.6, 15, 3.4), (1.3, 45, 2.6))):
            tilt = rotation_y(sweep * s) @ rotation_z(30 * s) @ rotation_x(35)
            root = np.array([0.7 * s, 1.5, z])
            parts.append((f"{side} wing {pair}", (length, 0.09, 1.2), tilt, root + tilt @ (length * s, 0, 0), "wing"))
        for pair, z in enumerate((3.0, 2.0, 1.0)):
            bend = rotation_y(25 * s * (pair - 1))
            thigh, shin = bend @ rotation_z(-35 * s), bend @ rotation_z(-80 * s)
            hip = np.array([0.9 * s, -0.3, z])
            knee = hip + thigh @ (2.0 * s, 0, 0)
            foot = knee + shin @ (1.9 * s, 0, 0)
            parts += [
                (f"{side} thigh {pair}", (1.1, 0.2, 0.2), thigh, (hip + knee) / 2, "black"),
                (f"{side} shin {pair}", (1.0, 0.14, 0.14), shin, (knee + foot) / 2, "yellow"),
                (f"{side} foot {pair}", (0.3, 0.2, 0.42), level, foot, "white"),
            ]
    turn = rotation_y(20) @ rotation_x(-12)
    return [
        Ellipsoid(f"Buzz {name}", axes, turn @ rotation, BUZZ + turn @ np.array(centre), material)
        for name, axes, rotation, centre, material in parts
    ]


def balls_on_plaza():
    """Two chrome balls at the plaza's front."""
    places = [(7, 2.2, 22), (13.5, 2.2, 20)]
    return [
        Ellipsoid(f"Ball {n}", (2.2, 2.2, 2.2), np.eye(3), np.array(place, float), "chrome")
        for n, place in enumerate(places)
    ]


# ---- camera


def camera_path():
    """Positions and rotations, a frame each: past the town, into it over the houses, and up to the yellowjacket."""
    frames = np.arange(FRAMES)
    eyes = camera.spline(
        {
            0: (-76, 17, 77),
            24: (-74.5, 17, 77),
            140: (-65, 20, 74),
            250: (-49, 23, 66),
            350: (-29, 21, 54),
            470: (0, 14, 43),
            599: (20, 9, 32),
        },
        frames,
    )
    heading, pitch, roll = camera.spline(
        {
            0: (-44.5, 0, 0),
            24: (-41.5, 0, 0),
            140: (-23, -4, 4),
            250: (-4, -8, -3),
            350: (12, -9, 3),
            470: (7, -3, 6),
            599: (-19, 7, -4),
        },
        frames,
    ).T
    return eyes, camera.look_along(heading, pitch, roll)
