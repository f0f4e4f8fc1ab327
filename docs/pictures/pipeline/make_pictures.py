"""Makes the pictures of docs/pipeline.md: a shot built in Blender, exported, converted, composited; and comparisons.

    python docs/pictures/pipeline/make_pictures.py shot
    python docs/pictures/pipeline/make_pictures.py beside NAME FILE.blend|STAGE.usda FRAME [camera-light]

Needs bpy, usd-core, numpy, OpenEXR, pillow and a built buzz-convert (BUZZ_CONVERT or target/release).
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "exporters" / "tests")]

import bpy
import render_tools as r

CONVERT = os.environ.get("BUZZ_CONVERT") or str(ROOT / "target" / "release" / "buzz-convert")
# Colours of the pixel classes: traced, good, overlapped, missed, bad, creeping, entering, edge, moved, filled.
CLASSES = np.array(
    [
        (230, 230, 230),
        (60, 110, 170),
        (90, 150, 210),
        (220, 60, 60),
        (240, 140, 40),
        (230, 200, 60),
        (180, 70, 190),
        (110, 190, 110),
        (250, 120, 170),
        (50, 80, 120),
    ]
)


def display(picture: np.ndarray, exposure: float | None = None) -> Image.Image:
    """Linear RGB as an sRGB picture; without an exposure, the 97th percentile comes out at 0.8."""
    scale = 0.8 / max(float(np.quantile(picture.max(axis=2), 0.97)), 1e-6) if exposure is None else exposure
    x = np.clip(picture * scale, 0, 1)
    x = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)
    return Image.fromarray((x * 255 + 0.5).astype(np.uint8))


def row(pictures: list[Image.Image], path: Path, gap: int = 8) -> None:
    """Pictures side by side on white."""
    out = Image.new("RGB", (sum(p.width for p in pictures) + gap * (len(pictures) - 1), max(p.height for p in pictures)), "white")
    x = 0
    for picture in pictures:
        out.paste(picture, (x, 0))
        x += picture.width + gap
    out.save(path, optimize=True)


def build_shot(path: Path) -> None:
    """A yard at 23.976 fps, frames 101-148: a dolly that zooms, and from frame 125 another camera."""
    import blender_scene as b

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = 24, 1.001
    scene.frame_start, scene.frame_end = 101, 148
    scene.render.resolution_x, scene.render.resolution_y = 640, 360
    world = bpy.data.worlds.new("Sky")
    if world.node_tree is None:
        world.use_nodes = True
    scene.world = world
    sky = world.node_tree.nodes["Background"].inputs
    sky["Color"].default_value, sky["Strength"].default_value = (0.35, 0.5, 0.8, 1), 0.35
    floor = b.plane("Floor", 60)
    made, shader = b.material("Paving")
    brick, where = made.node_tree.nodes.new("ShaderNodeTexBrick"), made.node_tree.nodes.new("ShaderNodeTexCoord")
    brick.inputs["Scale"].default_value = 40.0
    brick.inputs["Color1"].default_value, brick.inputs["Color2"].default_value = (0.45, 0.38, 0.3, 1), (0.55, 0.5, 0.42, 1)
    brick.inputs["Mortar"].default_value = (0.12, 0.11, 0.1, 1)
    made.node_tree.links.new(where.outputs["Generated"], brick.inputs["Vector"])
    made.node_tree.links.new(brick.outputs["Color"], shader.inputs["Base Color"])
    floor.data.materials.append(made)
    stone = b.material("Stone", (0.6, 0.55, 0.5))[0]
    for i in range(12):
        a = i / 12 * 2 * math.pi
        bpy.ops.mesh.primitive_cylinder_add(vertices=32, radius=0.45, depth=4, location=(7 * math.cos(a), 7 * math.sin(a), 2))
        bpy.context.object.data.materials.append(stone)
        bpy.ops.object.shade_smooth()
    ball = b.material("Copper", (0.85, 0.45, 0.3), 0.5)
    ball[1].inputs["Metallic"].default_value, ball[1].inputs["Roughness"].default_value = 1.0, 0.25
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=1.2, location=(0, 0, 1.2))
    bpy.context.object.data.materials.append(ball[0])
    bpy.ops.object.shade_smooth()
    b.light("SUN", "Sun", energy=3.0, angle=0.0).rotation_euler = (0.7, 0.25, 0.5)
    first, second = b.camera("Dolly", (0, -16, 2.2), (1.5, 0, 0)), b.camera("Crane", (11, -9, 8), (1.05, 0, 0.9))
    b.key(first, "location", {101: (-4, -16, 2.2), 148: (4, -12, 2.6)}, interpolation="BEZIER")
    b.key(first, "rotation_euler", {101: (1.48, 0, -0.25), 148: (1.46, 0, 0.3)}, interpolation="BEZIER")
    b.key(first.data, "lens", {101: 32.0, 148: 45.0})
    b.key(second, "location", {125: (11, -9, 8), 148: (12.5, -6, 7)}, interpolation="BEZIER")
    for frame, ob in ((101, first), (125, second)):
        scene.timeline_markers.new(ob.name, frame=frame).camera = ob
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def composite(folder: Path, out: Path) -> None:
    """Load the sequence as the extension does, lay haze over it by depth, and write one frame with Blender's compositor."""
    from exporters.blender.compositor import compositor_tree, load_sequence

    scene = bpy.context.scene
    node = load_sequence(scene, folder)[0]
    tree = compositor_tree(scene)
    depth = next(s for s in node.outputs if "depth" in s.name.lower() or s.name == "Z")
    span = tree.nodes.new("ShaderNodeMapRange")
    span.inputs["From Min"].default_value, span.inputs["From Max"].default_value = 8.0, 40.0
    span.inputs["To Max"].default_value = 0.85
    span.clamp = True
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    colours = [s for s in mix.inputs if s.type == "RGBA"]
    tree.links.new(depth, span.inputs["Value"])
    tree.links.new(span.outputs["Result"], mix.inputs["Factor"])
    image = next((s for s in node.outputs if s.name in ("Image", "Combined")), node.outputs[0])
    tree.links.new(image, colours[0])
    colours[1].default_value = (0.75, 0.72, 0.66, 1)
    output = tree.nodes.new("NodeGroupOutput")
    tree.links.new(next(s for s in mix.outputs if s.type == "RGBA"), output.inputs[0])
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 1
    scene.view_settings.view_transform = "Standard"
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = str(out)
    scene.frame_set(110)
    bpy.ops.render.render(write_still=True)


def shot() -> None:
    """The pictures of the five steps."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        build_shot(folder / "shot.blend")
        script = ROOT / "exporters" / "blender" / "export.py"
        subprocess.run([sys.executable, str(script), str(folder / "shot.blend"), str(folder / "shot.gltf")], check=True)
        subprocess.run([CONVERT, str(folder / "shot.gltf"), str(folder / "out"), "--aov", "depth,class"], check=True)
        frames = {n: r.read_exr(p) for n, p in r.frames_of(folder / "out").items()}
        thumbs = [display(r.rgb(frames[n]), 0.9).resize((320, 180)) for n in (101, 124, 125, 148)]
        row(thumbs, HERE / "frames.png")
        chosen = 110
        classes = CLASSES[frames[chosen]["pixelClass.id"].astype(int)].astype(np.uint8)
        row(
            [display(r.rgb(frames[chosen]), 0.9).resize((480, 270)), Image.fromarray(classes).resize((480, 270), Image.Resampling.NEAREST)],
            HERE / "classes.png",
        )
        bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
        composite(folder / "out", folder / "comp.png")
        row([display(r.rgb(frames[chosen]), 0.9).resize((480, 270)), Image.open(folder / "comp.png").convert("RGB").resize((480, 270))], HERE / "composite.png")
        report = json.loads((folder / "out" / "report.json").read_text())
        print(json.dumps({"keyframes": report["plan"]["keyframes"], "pixels": report["totals"]["pixels"]}))


def beside(name: str, source: Path, frame: int, camera_light: bool) -> None:
    """Cycles (USD stages through Blender's importer) on the left, buzz-convert on the right; both scaled to the same brightness."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        script = "blender/export.py" if source.suffix == ".blend" else "usd/usd_to_gltf.py"
        subprocess.run([sys.executable, str(ROOT / "exporters" / script), str(source), str(folder / "s.gltf")], check=True)
        width, height = json.loads((folder / "s.gltf").read_text())["scenes"][0]["extras"]["buzz"]["resolution"]
        size = (480, round(480 * height / width))
        command = [CONVERT, str(folder / "s.gltf"), str(folder / "out"), "-q", "full", "-f", f"{frame}-{frame}", "-r", f"{size[0]}x{size[1]}"]
        subprocess.run(command, check=True)
        if source.suffix == ".blend":
            bpy.ops.wm.open_mainfile(filepath=str(source), load_ui=False)
        else:
            bpy.ops.wm.read_factory_settings(use_empty=True)
            bpy.ops.wm.usd_import(filepath=str(source))
        scene = bpy.context.scene
        scene.camera = scene.camera or next(ob for ob in scene.objects if ob.type == "CAMERA")
        r.cycles_settings(bpy)
        scene.cycles.samples, scene.cycles.max_bounces, scene.cycles.diffuse_bounces, scene.cycles.filter_width = 32, 8, 0, 1.5
        scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *size, 100
        scene.frame_set(frame)
        if camera_light:
            data = bpy.data.lights.new("camera light", "SUN")
            data.energy, data.angle = math.pi, 0
            ob = bpy.data.objects.new("camera light", data)
            scene.collection.objects.link(ob)
            ob.matrix_world = scene.camera.matrix_world.normalized()
        reference = r.cycles_render(bpy, folder / "cycles.exr", frame)
        ours = r.read_exr(next(iter(r.frames_of(folder / "out").values())))
        row([display(r.rgb(reference)), display(r.rgb(ours))], HERE / f"{name}.png")


if __name__ == "__main__":
    if sys.argv[1:2] == ["shot"]:
        shot()
    elif sys.argv[1:2] == ["beside"] and len(sys.argv) in (5, 6):
        beside(sys.argv[2], Path(sys.argv[3]), int(sys.argv[4]), sys.argv[5:] == ["camera-light"])
    else:
        sys.exit(__doc__)
