"""gallery: a hall of paintings with mirrors, a glass drop, a chrome ball and a bronze knot.

72 frames at 24 a second: the camera walks in, passes the bench and comes round the glass. Two lamps and two spots.
"""

import itertools

import numpy as np

import camera
import mesh
from gltf import Scene
from mesh import box, join, lathe, quad, sphere, unit
from texture import courses, mix, noise, normal_map, ramp, random_stream, smoothstep

FRAMES = 72

#: The hall: x = +-WIDE, from z = NEAR to z = FAR.
WIDE, NEAR, FAR, HIGH = 4.0, 7.0, -9.0, 4.2


def build():
    """The whole scene."""
    scene = Scene("gallery")
    materials = make_materials(scene)
    for part in (hall, pictures, mirrors, sculptures, benches, lamps):
        part(scene, materials)
    move_camera(scene)
    return scene


# ---- materials


def make_materials(scene):
    """Every material but the paintings, by name."""
    grain = noise(256, 16, seed=4, octaves=4)
    return {
        **parquet(scene),
        "wall": scene.material("Wall", colour=(0.78, 0.76, 0.72), roughness=0.9),
        "accent": scene.material("Accent wall", colour=(0.30, 0.055, 0.06), roughness=0.9),
        "ceiling": scene.material("Ceiling", colour=(0.85, 0.84, 0.82), roughness=0.95),
        "trim": scene.material("Trim", colour=(0.14, 0.09, 0.06), roughness=0.4),
        "plinth": scene.material(
            "Plinth",
            roughness=0.5,
            texture=scene.texture("marble", ramp(np.abs(grain - 0.5) * 2, (0.55, 0.55, 0.57), (0.93, 0.92, 0.9))),
        ),
        "gilt": scene.material("Gilt", colour=(0.95, 0.72, 0.34), metallic=1.0, roughness=0.35),
        "leather": scene.material("Leather", colour=(0.10, 0.045, 0.03), roughness=0.35),
        "mirror": scene.material("Mirror", colour=(0.95, 0.96, 0.96), metallic=1.0, roughness=0.0),
        "chrome": scene.material("Chrome", colour=(0.92, 0.92, 0.94), metallic=1.0, roughness=0.02),
        "bronze": scene.material("Bronze", colour=(0.80, 0.50, 0.26), metallic=1.0, roughness=0.2),
        "glass": scene.material(
            "Glass", roughness=0.0, ior=1.5, transmission=1.0, attenuation=((0.55, 0.90, 0.82), 0.45)
        ),
        "iron": scene.material("Iron", colour=(0.05, 0.05, 0.055), metallic=1.0, roughness=0.5),
        "glow": scene.material("Glow", emissive=(1.0, 0.93, 0.80), strength=1.6),
    }


def parquet(scene):
    """Polished boards: smooth enough to mirror the room faintly."""
    edge, tone = courses(512, 8, 2, seed=14, jitter=0.6)
    fibre = noise(512, 4, seed=15, octaves=5, stretch=16)
    colour = ramp(0.6 * tone + 0.4 * fibre, (0.30, 0.17, 0.09), (0.50, 0.31, 0.17), (0.62, 0.42, 0.25))
    board = smoothstep(0.0005, 0.003, edge)
    colour = mix(colour * 0.3, colour, board)
    relief = normal_map(0.5 * board + 0.04 * fibre, 1.2)
    return {
        "parquet": scene.material(
            "Parquet",
            roughness=0.14,
            texture=scene.texture("parquet", colour),
            normal=scene.texture("parquet_normal", relief[::2, ::2]),
            normal_scale=0.25,
        )
    }


# ---- the hall


def hall(scene, materials):
    """Floor, walls with a plinth rail, ceiling with a long skylight."""
    w, near, far, h = WIDE, NEAR, FAR, HIGH
    floor = quad((-w, 0, near), (w, 0, near), (w, 0, far), (-w, 0, far), tile=2.4)
    left = quad((-w, 0, near), (-w, 0, far), (-w, h, far), (-w, h, near))
    right = quad((w, 0, far), (w, 0, near), (w, h, near), (w, h, far))
    back = quad((w, 0, near), (-w, 0, near), (-w, h, near), (w, h, near))
    end = quad((-w, 0, far), (w, 0, far), (w, h, far), (-w, h, far))
    skirting = [
        box((-w, 0, far), (-w + 0.04, 0.16, near), skip="xyzZ"),
        box((w - 0.04, 0, far), (w, 0.16, near), skip="XyzZ"),
        box((-w, 0, far), (w, 0.16, far + 0.04), skip="zyxX"),
        box((-w, 0, near - 0.04), (w, 0.16, near), skip="ZyxX"),
    ]
    # The skylight is a recess between two strips of ceiling, crossed by beams.
    strips = [quad((x0, h, far), (x1, h, far), (x1, h, near), (x0, h, near)) for x0, x1 in ((-w, -1.3), (1.3, w))]
    cheeks = [
        quad((-1.3, h, near), (-1.3, h, far), (-1.3, h + 0.5, far), (-1.3, h + 0.5, near)),
        quad((1.3, h, far), (1.3, h, near), (1.3, h + 0.5, near), (1.3, h + 0.5, far)),
        quad((-1.3, h, far), (1.3, h, far), (1.3, h + 0.5, far), (-1.3, h + 0.5, far)),
        quad((1.3, h, near), (-1.3, h, near), (-1.3, h + 0.5, near), (1.3, h + 0.5, near)),
    ]
    beams = [box((-1.3, h, z - 0.06), (1.3, h + 0.35, z + 0.06), skip="xXY") for z in np.arange(far + 1, near, 2.0)]
    pane = quad((-1.3, h + 0.5, far), (1.3, h + 0.5, far), (1.3, h + 0.5, near), (-1.3, h + 0.5, near))
    for name, surface, material in (
        ("Floor", floor, "parquet"),
        ("Walls", join([left, right, back]), "wall"),
        ("End wall", end, "accent"),
        ("Skirting", join(skirting), "trim"),
        ("Ceiling", join([*strips, *cheeks]), "ceiling"),
        ("Beams", join(beams), "ceiling"),
        ("Skylight", pane, "glow"),
    ):
        scene.node(name, mesh=scene.mesh(name, (surface, materials[material])))


def frame(width, height, bar=0.11, depth=0.07):
    """A moulded picture frame about a picture of that size, centred, on the wall z = 0."""
    profile = [(0.0, 0.0), (0.0, depth), (bar * 0.35, depth * 0.7), (bar * 0.7, depth), (bar, 0.0)]
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]
    loops = [[(sx * (width / 2 + out), sy * (height / 2 + out), z) for sx, sy in corners] for out, z in profile]
    return join(mesh.strip(inner, outer) for inner, outer in itertools.pairwise(loops))


def picture(width, height):
    """A canvas whose texture fills it once, just off the wall z = 0."""
    x, y, z = width / 2, height / 2, 0.02
    canvas = quad((-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z))
    canvas.uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], float)
    return canvas


def pictures(scene, materials):
    """Six paintings, three on each side wall."""
    hung = [
        ("Fields", fields(256), (-WIDE, 1.75, 4.4), 90, (1.5, 1.7)),
        ("Hills", hills(256), (-WIDE, 1.75, 1.2), 90, (2.4, 1.5)),
        ("Grid", grid(256), (-WIDE, 1.75, -6.9), 90, (1.5, 1.5)),
        ("Circles", circles(256), (WIDE, 1.75, 3.4), -90, (1.7, 1.7)),
        ("Marbling", marbling(256), (WIDE, 1.75, 0.2), -90, (2.2, 1.5)),
        ("Night", night(256), (WIDE, 1.75, -6.6), -90, (1.6, 1.9)),
    ]
    for name, image, place, turn, (width, height) in hung:
        paint = scene.material(name, roughness=0.6, texture=scene.texture(name.lower(), image))
        parts = [(picture(width, height), paint), (frame(width, height), materials["gilt"])]
        scene.node(name, place, turn=turn, mesh=scene.mesh(name, *parts))


# ---- the paintings


def fields(size):
    """Two soft-edged fields of colour on a third."""
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size
    wobble = 0.02 * (noise(size, 6, seed=81) - 0.5)
    brush = noise(size, 4, seed=82, octaves=6)[..., None] * 0.18 + 0.91
    side = smoothstep(0.07, 0.11, np.minimum(x, 1 - x) + wobble)
    image = np.ones((size, size, 3)) * [0.55, 0.10, 0.07]
    for low, high, colour in ((0.08, 0.50, (0.93, 0.48, 0.08)), (0.55, 0.92, (0.28, 0.05, 0.12))):
        inside = side * smoothstep(0, 0.04, y - low + wobble) * smoothstep(0, 0.04, high - y + wobble)
        image = mix(image, np.ones_like(image) * colour, inside)
    return image * brush


def hills(size):
    """Blue hills one behind the other under an evening sun."""
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size
    image = ramp(y * 1.4, (0.35, 0.45, 0.70), (0.95, 0.72, 0.50), (1.0, 0.88, 0.62))
    sun = smoothstep(0.075, 0.07, np.hypot((x - 0.68) * 1.6, y - 0.36))
    image = mix(image, np.ones_like(image) * [1.0, 0.95, 0.80], sun)
    for layer in range(5):
        ridge = noise(size, 3 + layer, seed=90 + layer)[0]
        line = 0.40 + 0.12 * layer - 0.22 * (ridge - 0.4)
        tone = layer / 4
        colour = np.array([0.45, 0.50, 0.66]) * (1 - tone) + np.array([0.09, 0.17, 0.13]) * tone
        image = mix(image, np.ones_like(image) * colour, smoothstep(0, 0.006, y - line[None, :]))
    return image * (0.93 + 0.12 * noise(size, 24, seed=96)[..., None])


def grid(size):
    """Black bars and a few bright rectangles on white."""
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size
    image = np.full((size, size, 3), 0.93)
    for x0, y0, x1, y1, colour in (
        (0.0, 0.0, 0.30, 0.38, (0.85, 0.10, 0.08)),
        (0.72, 0.62, 1.0, 1.0, (0.08, 0.16, 0.55)),
        (0.30, 0.78, 0.72, 1.0, (0.97, 0.80, 0.10)),
    ):
        image[(x >= x0) & (x < x1) & (y >= y0) & (y < y1)] = colour
    bar = np.minimum.reduce([np.abs(x - p) for p in (0.30, 0.72)] + [np.abs(y - p) for p in (0.38, 0.62, 0.78)])
    return mix(np.full_like(image, 0.05), image, smoothstep(0.012, 0.016, bar))


def circles(size):
    """Four by four tiles of concentric rings."""
    random = random_stream(17)
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size * 4
    radius = np.hypot(x % 1 - 0.5, y % 1 - 0.5)
    radius = radius + 0.03 * (noise(size, 24, seed=98) - 0.5)
    ring = np.clip(radius / 0.145, 0, 4).astype(int)
    palette = random.random_sample((4, 4, 5, 3)) ** 0.8
    return palette[y.astype(int), x.astype(int), ring] * 0.85 + 0.08


def marbling(size):
    """Combed bands of ink."""
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size
    warp = noise(size, 3, seed=101, octaves=5) + 0.5 * noise(size, 5, seed=111, octaves=3)
    bands = (5 * x + 3.5 * warp + 0.35 * np.sin(2 * np.pi * 7 * y)) % 1
    inks = [(0.04, 0.15, 0.33), (0.07, 0.40, 0.46), (0.93, 0.88, 0.76), (0.80, 0.33, 0.14), (0.04, 0.15, 0.33)]
    return ramp(bands, *inks)


def night(size):
    """Stars and a moon over dark water."""
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size
    image = ramp(y * 1.3, (0.02, 0.03, 0.12), (0.07, 0.13, 0.32), (0.28, 0.36, 0.52))
    for sx, sy, glow in random_stream(23).random_sample((60, 3)):
        spot = np.exp(-(((x - sx) ** 2 + (y - 0.6 * sy) ** 2) / (2e-5 + 6e-5 * glow)))
        image = mix(image, np.ones_like(image) * [1.0, 0.96, 0.80], np.clip(spot, 0, 1))
    moon = smoothstep(0.09, 0.085, np.hypot(x - 0.30, (y - 0.26) * 1.2))
    image = mix(image, np.ones_like(image) * [0.98, 0.95, 0.84], moon)
    ripple = noise(size, 3, seed=131, octaves=4, stretch=16)
    path = np.exp(-(((x - 0.30) / 0.16) ** 2)) * smoothstep(0.5, 0.75, ripple)
    water = mix(ramp(ripple, (0.02, 0.05, 0.13), (0.10, 0.18, 0.30)), np.ones_like(image) * [0.9, 0.86, 0.7], path)
    return mix(image, water, smoothstep(0.699, 0.701, y))


# ---- what stands in the hall


def mirrors(scene, materials):
    """A tall mirror on either side, not quite opposite each other, and a wide one at the end."""
    for name, place, turn, (width, height) in (
        ("Left mirror", (-WIDE, 1.7, -3.0), 90, (1.9, 2.7)),
        ("Right mirror", (WIDE, 1.7, -3.4), -90, (1.9, 2.7)),
        ("End mirror", (0.0, 1.9, FAR), 0, (3.2, 2.2)),
    ):
        parts = [(picture(width, height), materials["mirror"]), (frame(width, height), materials["gilt"])]
        scene.node(name, place, turn=turn, mesh=scene.mesh(name, *parts))


def knot(turns=2, twists=3, around=320, tube=24):
    """A torus knot of radius one, upright."""
    t = np.linspace(0, 2 * np.pi, around, endpoint=False)
    angles = np.linspace(0, 2 * np.pi, tube, endpoint=False)

    def curve(t):
        reach = 0.68 + 0.32 * np.cos(twists * t)
        return np.stack([reach * np.cos(turns * t), reach * np.sin(turns * t), 0.34 * np.sin(twists * t)], axis=-1)

    centre = curve(t)
    ahead = unit(curve(t + 1e-3) - curve(t - 1e-3))
    # Across the tube: away from the middle of the hole, at right angles to the curve; it never runs along it.
    out = np.stack([np.cos(turns * t), np.sin(turns * t), 0 * t], axis=-1)
    side = unit(out - ahead * np.sum(out * ahead, axis=1, keepdims=True))
    up = np.cross(ahead, side)
    normals = side[:, None] * np.cos(angles)[:, None] + up[:, None] * np.sin(angles)[:, None]
    positions = centre[:, None] + 0.17 * normals
    i, j = np.meshgrid(np.arange(around), np.arange(tube), indexing="ij")
    here, there = i * tube, (i + 1) % around * tube
    a, b, c, d = (k.ravel() for k in (here + j, there + j, there + (j + 1) % tube, here + (j + 1) % tube))
    triangles = np.concatenate([np.column_stack([a, d, c]), np.column_stack([a, c, b])])
    flat = positions.reshape(-1, 3)
    return mesh.Surface(flat, normals.reshape(-1, 3), flat[:, :2], triangles)


def sculptures(scene, materials):
    """The glass drop, the chrome ball and the bronze knot, each on a plinth."""
    plinth = join([box((-0.3, 0, -0.3), (0.3, 0.9, 0.3), 1.2, skip="y"), box((-0.34, 0.9, -0.34), (0.34, 0.96, 0.34))])
    stand = scene.mesh("Plinth", (plinth, materials["plinth"]))
    places = {"Glass drop": (-0.6, -2.4), "Chrome ball": (-1.5, -5.6), "Bronze knot": (1.7, -5.2)}
    for name, (x, z) in places.items():
        scene.node(f"{name} plinth", (x, 0, z), mesh=stand)

    height = np.linspace(0, 1, 40)
    girth = 0.30 * np.sqrt(np.sin(np.pi * height**0.62)) * (1 - 0.45 * height**2)
    girth[[0, -1]] = 0
    drop = lathe(np.column_stack([girth, 0.75 * height]), 64)
    ball = sphere(48, 96, 0.36).moved((0, 0.36, 0))
    figure = knot().moved((0, 0.62, 0), scale=(0.6,) * 3)
    for name, surface, material in (
        ("Glass drop", drop, "glass"),
        ("Chrome ball", ball, "chrome"),
        ("Bronze knot", figure, "bronze"),
    ):
        x, z = places[name]
        scene.node(name, (x, 0.962, z), turn=35, mesh=scene.mesh(name, (surface, materials[material])))


def benches(scene, materials):
    """Two padded benches down the middle."""
    cushions = [box((x - 0.44, 0.38, -0.28), (x + 0.44, 0.48, 0.28)) for x in (-0.45, 0.45)]
    legs = [box((x, 0, z), (x + 0.06, 0.33, z + 0.06), skip="yY") for x in (-0.8, 0.74) for z in (-0.24, 0.18)]
    rail = box((-0.88, 0.33, -0.27), (0.88, 0.38, 0.27))
    bench = scene.mesh("Bench", (join(cushions), materials["leather"]), (join([*legs, rail]), materials["trim"]))
    for i, (x, z, turn) in enumerate([(0.5, 1.7, 90), (0.2, -7.2, 0)]):
        scene.node(f"Bench {i}", (x, 0, z), turn=turn, mesh=bench)


def lamps(scene, materials):
    """Two globes on rods give the general light; two spots on the ceiling pick out the glass and the end wall."""
    # The lights hang under their globes, which would shade them.
    globe = sphere(16, 32, 0.12)
    rod = lathe([(0.012, 0.1), (0.012, 1.6)], 8)
    pendant = scene.mesh("Pendant", (globe, materials["glow"]), (rod, materials["iron"]))
    for name, z in (("near", 3.2), ("far", -4.6)):
        scene.node(f"Pendant {name}", (0, 3.4, z), mesh=pendant)
        scene.lamp(f"Lamp {name}", (0, 3.22, z), watts=260, colour=(1.0, 0.90, 0.76), radius=0.05)
    can = lathe([(0.05, -0.09), (0.06, -0.09), (0.06, -0.09), (0.06, 0.09), (0.06, 0.09), (0.0, 0.11)], 24)
    spot = scene.mesh("Spot", (can, materials["iron"]))
    for name, place, target in (
        ("glass", (1.9, 4.05, -0.6), (-0.6, 1.3, -2.4)),
        ("end", (-1.9, 4.05, -5.0), (0.0, 1.6, FAR)),
    ):
        place, direction = np.array(place), unit(np.array(target) - place)
        scene.node(f"Spot {name}", place, rotation=upright_to(-direction), mesh=spot)
        scene.spot(f"Spot light {name}", place + 0.12 * direction, direction, watts=420, cone=(18, 34), radius=0.03)


def upright_to(direction):
    """The quaternion of the shortest turn from +y to `direction`."""
    x, y, z = direction
    return unit([z, 0.0, -x, 1.0 + y])


# ---- camera


def move_camera(scene):
    """In from the door, past the bench, round the glass."""
    frames = np.arange(FRAMES)
    eyes = camera.spline(
        {0: (-1.9, 1.62, 5.6), 24: (-1.2, 1.6, 3.2), 48: (0.5, 1.56, 0.6), 71: (1.5, 1.5, -1.6)}, frames
    )
    targets = camera.spline({0: (0.2, 1.5, -4.0), 30: (-0.2, 1.4, -3.0), 71: (-0.9, 1.35, -2.6)}, frames)
    scene.shots(
        [("Camera", eyes, camera.quaternions(camera.look_at(eyes, targets)))],
        yfov=np.radians(46),
        fps=24,
        resolution=(1280, 720),
        world={"color": [0.16, 0.16, 0.17], "strength": 1.0},
    )
