"""Blender's Cycles against the export as buzz-convert renders it: silhouettes, depth, lit values."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

SIZE = (160, 90)


def stand(blender):
    """A grey floor, three shapes and a camera that looks down on them."""
    import blender_scene as b
    import render_tools as r

    scene = blender.context.scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.frame_start = scene.frame_end = 1
    b.camera(location=(0.4, -9, 4.5), rotation=(1.12, 0.05, 0.03), lens=40.0)
    objects = [b.plane("Floor", 40)]
    for i, colour in enumerate([(0.8, 0.3, 0.2), (0.2, 0.6, 0.3)]):
        objects.append(b.cube(f"Cube {i}", (2.5 * i - 1.5, 0.7 * i, 1.0 + i)))
        objects[-1].rotation_euler = (0.2 * i, 0.3, 0.5)
        objects[-1].data.materials.append(b.material(f"M{i}", colour)[0])
    blender.ops.mesh.primitive_uv_sphere_add(location=(-3.2, 1.5, 1.2), segments=48, ring_count=24)
    ball = blender.context.object
    ball.name = "Ball"
    blender.ops.object.shade_smooth()
    objects.append(ball)
    ball.data.materials.append(b.material("Blue", (0.1, 0.2, 0.7))[0])
    objects[0].data.materials.append(b.material("Floor", (0.5, 0.5, 0.5))[0])
    for i, ob in enumerate(objects):
        ob.pass_index = i + 1
    r.cycles_settings(blender)
    return scene


LIGHTS = {
    "point": ("POINT", {"energy": 400.0, "shadow_soft_size": 0.0, "location": (1, -4, 5)}, (0, 0, 0)),
    "spot": ("SPOT", {"energy": 800.0, "shadow_soft_size": 0.0, "spot_size": 1.6, "spot_blend": 0.3, "location": (0, -3, 7)}, (0.4, 0, 0)),
    "sun": ("SUN", {"energy": 3.0, "angle": 0.0}, (0.6, 0.3, 0.2)),
    "area": ("AREA", {"energy": 300.0, "size": 0.05, "location": (1, -4, 6)}, (0.5, 0.1, 0)),
}


def needs_area_lights(buzz, gltf) -> None:
    """Skip where the renderer itself says that it leaves a light's size out."""
    scene = json.loads(buzz("inspect", "--format", "json", gltf.path).stdout)
    if any("extras" in str(item) and ("area" in str(item) or "radius" in str(item)) for item in scene["ignored"]):
        pytest.skip("SKIPPED LOUDLY: this buzz-convert does not render the size of lights yet")


@pytest.mark.parametrize("kind", LIGHTS)
def test_lit_values_depth_and_silhouettes(blender, export, buzz, tmp_path, kind):
    import blender_scene as b
    import render_tools as r

    stand(blender)
    name, settings, rotation = LIGHTS[kind]
    lamp = b.light(name, **settings)
    lamp.rotation_euler = rotation
    cycles = r.cycles_render(blender, tmp_path / "cycles.exr")
    gltf = export()
    if kind == "area":
        needs_area_lights(buzz, gltf)
    buzz(gltf.path, tmp_path / "out", "--aov", "depth,object,class,normal", "-q", "full")
    ours = r.read_exr(r.frames_of(tmp_path / "out")[1])
    hit = cycles["Z"] < 1e9
    assert r.mask_difference(ours["objectId.id"], cycles["index"]) < 0.003
    both = hit & (ours["depth.Z"] < 1e9)
    # Where one picture has the edge of an object, depth jumps: silhouettes are measured above.
    relative = np.abs(ours["depth.Z"] - cycles["Z"])[both] / cycles["Z"][both]
    assert np.quantile(relative, 0.995) < 1e-4
    lit = both & (r.rgb(cycles).max(axis=2) > 0.02) & (np.abs(ours["depth.Z"] - cycles["Z"]) < 1e-3 * cycles["Z"])
    if kind == "spot":
        lit &= inside_cone(ours, cycles, gltf, lamp)
    assert lit.sum() > 500
    ratio = r.rgb(ours)[lit] / np.maximum(r.rgb(cycles)[lit], 1e-9)
    close = np.abs(ratio - 1).max(axis=1) < 0.03
    assert close.mean() > 0.985, f"median ratio {np.median(ratio):.4f}, {close.mean():.3f} within 3 %"
    assert np.median(ratio) == pytest.approx(1, abs=0.005)


def inside_cone(ours, cycles, gltf, lamp) -> np.ndarray:
    """Pixels whose surface lies inside the spot's inner cone, from depth and the camera."""
    height, width = ours["depth.Z"].shape
    p = gltf.clip_from_camera(gltf.camera_at(1), 1)
    x = (np.arange(width) + 0.5) / width * 2 - 1
    y = 1 - (np.arange(height) + 0.5) / height * 2
    z = ours["depth.Z"]
    points = np.stack([(x[None, :] + p[0, 2]) / p[0, 0] * z, (y[:, None] + p[1, 2]) / p[1, 1] * z, -z, np.ones_like(z)], axis=-1)
    world = points @ gltf.world(gltf.camera_at(1), 1).T
    light = gltf.world(gltf.node(lamp.name), 1)
    towards = world[..., :3] - light[:3, 3]
    cosine = (towards @ -light[:3, 2]) / np.linalg.norm(towards, axis=-1)
    inner = gltf.light(lamp.name)[1]["spot"]["innerConeAngle"]
    return cosine > math.cos(inner - 0.01)


def test_soft_and_large_lights(blender, export, buzz, tmp_path):
    """Lights that have a size: the mean over a floor without occluders, where noise averages out."""
    import blender_scene as b
    import render_tools as r

    scene = blender.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 48, 27
    scene.frame_start = scene.frame_end = 1
    b.camera(location=(0, 0, 9), rotation=(0, 0, 0))
    b.plane("Floor", 40).data.materials.append(b.material("Floor", (0.5, 0.5, 0.5))[0])
    lamp = b.light("AREA", energy=200.0, location=(0, 0, 6), shape="RECTANGLE", size=3.0, size_y=1.0)
    r.cycles_settings(blender)
    scene.cycles.samples = 64
    lamp.visible_camera = False
    cycles = r.cycles_render(blender, tmp_path / "cycles.exr")
    gltf = export()
    needs_area_lights(buzz, gltf)
    buzz(gltf.path, tmp_path / "out", "-q", "full", "--light-samples", "16")
    ours = r.read_exr(r.frames_of(tmp_path / "out")[1])
    # Corners are far from the light: point-like there. Under the light, its size counts.
    ratio = r.rgb(ours)[..., 0] / r.rgb(cycles)[..., 0]
    edge = np.concatenate([ratio[0], ratio[-1]])
    assert np.median(edge) == pytest.approx(1, abs=0.06)


SOFT = {
    "sphere": ("POINT", {"energy": 400.0, "shadow_soft_size": 0.6, "use_soft_falloff": False, "location": (0.5, -1, 4)}, (0, 0, 0)),
    "spot": (
        "SPOT",
        {"energy": 800.0, "shadow_soft_size": 0.5, "use_soft_falloff": False, "spot_size": 2.4, "spot_blend": 0.0, "location": (0, -1, 5)},
        (0.2, 0, 0),
    ),
    "sun": ("SUN", {"energy": 3.0, "angle": 0.4}, (0.6, 0.3, 0.2)),
    "rectangle": ("AREA", {"energy": 300.0, "shape": "RECTANGLE", "size": 2.0, "size_y": 1.0, "location": (0.5, -1, 4)}, (0.3, 0.2, 0.4)),
    "ellipse": ("AREA", {"energy": 300.0, "shape": "ELLIPSE", "size": 2.0, "size_y": 1.0, "location": (0.5, -1, 3)}, (0.3, 0.2, 0.4)),
}


@pytest.mark.parametrize("kind", [*SOFT, "sky"])
def test_soft_shadows(blender, export, buzz, tmp_path, kind):
    """Penumbras on a floor under a cube, pixel by pixel. Blender's soft falloff makes spheres discs that face each point."""
    import blender_scene as b
    import render_tools as r

    scene = blender.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 48, 27
    scene.frame_start = scene.frame_end = 1
    b.camera(location=(0, -7, 7), rotation=(0.8, 0, 0))
    matt, _ = b.material("Matt", (0.5, 0.5, 0.5))
    for thing in (b.plane("Floor", 40), b.cube("Cube", (0, 0, 1.2))):
        thing.data.materials.append(matt)
    if kind == "sky":
        scene.world = blender.data.worlds.new("World")
        scene.world.use_nodes = True
        scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.8, 0.8, 0.8, 1)
    else:
        name, settings, rotation = SOFT[kind]
        lamp = b.light(name, **settings)
        lamp.rotation_euler = rotation
        lamp.visible_camera = False
    r.cycles_settings(blender)
    scene.cycles.samples = 1024
    cycles = r.rgb(r.cycles_render(blender, tmp_path / "cycles.exr"))[..., 0]
    gltf = export()
    buzz(gltf.path, tmp_path / "out", "-q", "full", "--light-samples", "256", "--ambient-samples", "256")
    ours = r.rgb(r.read_exr(r.frames_of(tmp_path / "out")[1]))[..., 0]
    brightest = np.quantile(cycles, 0.99)
    off = np.abs(ours - cycles) / brightest
    # Edges of the cube are silhouettes, measured elsewhere.
    assert np.quantile(off, 0.98) < 0.02, f"{np.quantile(off, [0.5, 0.9, 0.98])}"
    assert ours.mean() == pytest.approx(cycles.mean(), rel=0.005)
    assert ((cycles > 0.1 * brightest) & (cycles < 0.7 * brightest)).sum() > 20


@pytest.mark.parametrize("case", ["shift", "portrait vertical", "ortho", "pixel aspect", "23.976 cut"])
def test_pictures_line_up(blender, export, buzz, tmp_path, case):
    """Silhouettes for each lens, at the frame after a cut too."""
    import blender_scene as b
    import render_tools as r

    scene = stand(blender)
    camera, frame = scene.camera, 1
    if case == "shift":
        camera.data.shift_x, camera.data.shift_y = 0.15, -0.1
    elif case == "portrait vertical":
        scene.render.resolution_x, scene.render.resolution_y = 90, 120
        camera.data.sensor_fit = "VERTICAL"
    elif case == "ortho":
        camera.data.type, camera.data.ortho_scale = "ORTHO", 11.0
    elif case == "pixel aspect":
        scene.render.pixel_aspect_y, scene.render.film_transparent = 1.5, True
        blender.data.objects["Floor"].hide_render = True
    else:
        scene.render.fps, scene.render.fps_base = 24, 1.001
        scene.frame_start, scene.frame_end, frame = 101, 104, 103
        other = b.camera("Other", (6, -6, 4), (1.15, 0, 0.8))
        for at, ob in ((101, camera), (103, other)):
            scene.timeline_markers.new(str(at), frame=at).camera = ob
        b.key(other, "location", {101: (6, -6, 4), 104: (5, -7, 4)})
    b.light("SUN", energy=2.0)
    gltf = export()
    buzz(gltf.path, tmp_path / "out", "--aov", "depth,object", "-q", "full", "-f", str(frame))
    ours = r.read_exr(r.frames_of(tmp_path / "out")[frame])
    if case == "pixel aspect":
        # Blender cannot write several layers with a pixel aspect (its OpenEXR headers then differ): compare the sky's mask.
        cycles = r.cycles_render(blender, tmp_path / "cycles.exr", frame, layers=False)
        assert (((ours["depth.Z"] < 1e9) != (cycles["A"] > 0.5)).mean()) < 0.003
        return
    cycles = r.cycles_render(blender, tmp_path / "cycles.exr", frame)
    assert ours["objectId.id"].shape == cycles["index"].shape
    assert r.mask_difference(ours["objectId.id"], cycles["index"]) < 0.003


@pytest.mark.parametrize(
    ("kind", "settings"),
    [
        ("POINT", {"energy": 10.0, "shadow_soft_size": 0.2}),
        ("SPOT", {"energy": 10.0, "shadow_soft_size": 0.2, "spot_size": 3.1}),
        ("SUN", {"energy": 10.0, "angle": 0.1}),
        ("AREA", {"energy": 10.0, "shape": "RECTANGLE", "size": 0.5, "size_y": 0.4}),
        ("AREA", {"energy": 10.0, "shape": "DISK", "size": 0.5}),
    ],
)
@pytest.mark.parametrize("changed", [{"normalize": False}, {"exposure": 1.5}])
def test_light_settings_scale_as_in_cycles(blender, export, tmp_path, kind, settings, changed):
    """What a setting does to the brightness in Cycles, it does to the intensity in the file."""
    import blender_scene as b
    import render_tools as r

    scene = blender.context.scene
    scene.render.resolution_x = scene.render.resolution_y = 5
    scene.frame_end = 1
    b.camera(location=(0, 0, 9), rotation=(0, 0, 0), lens=100.0)
    b.plane("Floor", 40).data.materials.append(b.material()[0])
    lamp = b.light(kind, location=(0, 3, 6), **settings)
    if not hasattr(lamp.data, next(iter(changed))):
        pytest.skip(f"this Blender's lights have no {next(iter(changed))}")
    r.cycles_settings(blender)
    scene.cycles.samples = 64
    seen, written = [], []
    for values in ({}, changed):
        for key, value in values.items():
            setattr(lamp.data, key, value)
        seen.append(r.cycles_render(blender, tmp_path / "cycles.exr")["R"].mean())
        written.append(export().light("Light")[1]["intensity"])
    assert written[1] / written[0] == pytest.approx(seen[1] / seen[0], rel=0.01)
