"""The extension: built and validated by Blender's own tool, switched on, its operators run from its menu's names."""

from __future__ import annotations

import hashlib
import importlib
import os
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest

BLENDER = Path(__file__).resolve().parents[1] / "blender"


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """The built zip, unpacked where Python finds it."""
    pytest.importorskip("bpy", reason="SKIPPED LOUDLY: the bpy package is not installed (pip install bpy)")
    folder = tmp_path_factory.mktemp("extension")
    done = subprocess.run([sys.executable, str(BLENDER / "build.py"), str(folder / "buzz.zip")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    zipfile.ZipFile(folder / "buzz.zip").extractall(folder / "buzz_gltf_test")
    sys.path.insert(0, str(folder))
    return folder


@pytest.fixture
def extension(blender, package):
    """The extension, switched on."""
    module = importlib.import_module("buzz_gltf_test")
    module.register()
    yield module
    module.unregister()


@pytest.fixture
def shot(blender, extension, tmp_path):
    """A saved shot with a selection, an active object and a frame that is not the first."""
    import blender_scene as b

    scene = blender.context.scene
    scene.frame_end = 3
    ob = b.camera()
    b.key(ob, "location", {1: (0, -8, 2), 3: (1, -8, 2)})
    b.cube("Chosen").select_set(True)
    b.light("SUN", energy=2.0)
    blender.context.view_layer.objects.active = blender.data.objects["Chosen"]
    scene.frame_set(2)
    path = tmp_path / "shot.blend"
    blender.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def state(bpy) -> dict:
    """What an export must leave alone."""
    scene = bpy.context.scene
    return {
        "objects": [(o.name, o.select_get(), tuple(map(tuple, o.matrix_world)), o.hide_viewport) for o in scene.objects],
        "data": [len(getattr(bpy.data, kind)) for kind in ("objects", "meshes", "scenes", "images", "materials", "collections")],
        "frame": scene.frame_current,
        "active": bpy.context.view_layer.objects.active.name,
        "file": bpy.data.filepath,
        "dirty": bpy.data.is_dirty,
    }


def test_export_operator_changes_nothing(blender, shot, tmp_path):
    before, digest = state(blender), hashlib.sha256(shot.read_bytes()).hexdigest()
    assert blender.ops.export_scene.buzz_gltf(filepath=str(tmp_path / "o" / "anim.gltf")) == {"FINISHED"}
    assert (tmp_path / "o" / "anim.gltf").is_file()
    assert state(blender) == before
    assert hashlib.sha256(shot.read_bytes()).hexdigest() == digest


def test_panel_settings_reach_the_file(blender, shot, tmp_path):
    from gltf_reader import Gltf

    settings = blender.context.scene.buzz
    settings.output = str(tmp_path / "out")
    settings.use_range, settings.first, settings.last = True, -2, 1
    settings.use_resolution, settings.width, settings.height = True, 20, 10
    settings.camera = blender.data.objects["Camera"]
    settings.camera.name = blender.context.scene.name = "-Minus"
    assert blender.ops.render.buzz_export() == {"FINISHED"}
    buzz = Gltf(tmp_path / "out" / "shot.gltf").buzz
    assert (buzz["frame_start"], buzz["frame_end"], buzz["resolution"]) == (-2, 1, [20, 10])
    assert buzz["cuts"][0]["camera"] == "-Minus"


def test_export_and_convert_loads_the_sequence(blender, shot, buzz, tmp_path, monkeypatch):
    from conftest import binary

    monkeypatch.setenv("BUZZ_CONVERT", binary())
    blender.context.scene.buzz.output = str(tmp_path / "out")
    assert blender.ops.render.buzz_export(convert=True) == {"FINISHED"}
    assert len(list((tmp_path / "out" / "shot").glob("*.exr"))) == 3
    from exporters.blender.compositor import compositor_tree

    node = next(n for n in compositor_tree(blender.context.scene).nodes if n.type == "IMAGE")
    assert node.image.source == "SEQUENCE"
    assert (node.frame_start, node.frame_duration, node.frame_offset) == (1, 3, 0)


def test_disk_caches_come_along(blender, shot, tmp_path):
    import blender_scene as b
    from gltf_reader import Gltf

    ob = b.plane("Cloth", size=2)
    cache = ob.modifiers.new("Cloth", "CLOTH").point_cache
    cache.frame_start, cache.frame_end, cache.use_disk_cache = 1, 3, True
    with blender.context.temp_override(active_object=ob, object=ob, point_cache=cache):
        blender.ops.ptcache.bake(bake=True)
    blender.ops.wm.save_mainfile()
    blender.ops.export_scene.buzz_gltf(filepath=str(tmp_path / "o" / "anim.gltf"))
    gltf = Gltf(tmp_path / "o" / "anim.gltf")
    assert gltf.posed_points(gltf.node("Cloth"), 3)[:, 1].max() < -0.01, "it falls"
    assert list((tmp_path / "blendcache_shot").iterdir()), "they stay where they are"


def test_caches_that_are_not_baked_are_left_alone(blender, shot, tmp_path):
    """The export's levels are the render's, so that it cannot use them and makes its own."""
    import blender_scene as b

    ob = b.plane("Cloth", size=2)
    ob.modifiers.new("Subdivision", "SUBSURF").render_levels = 2
    cache = ob.modifiers.new("Cloth", "CLOTH").point_cache
    cache.frame_start, cache.frame_end, cache.use_disk_cache = 1, 3, True
    for frame in (1, 2, 3):
        b.set_frame(frame)
    blender.ops.wm.save_mainfile()
    before = {path: path.read_bytes() for path in (tmp_path / "blendcache_shot").iterdir()}
    blender.ops.export_scene.buzz_gltf(filepath=str(tmp_path / "o" / "anim.gltf"))
    assert before
    assert {path: path.read_bytes() for path in (tmp_path / "blendcache_shot").iterdir()} == before


def test_folders_of_bakes_are_found_from_the_copy(blender, extension, shot, tmp_path):
    nodes = blender.data.objects["Chosen"].modifiers.new("Nodes", "NODES")
    nodes.bake_directory = "//bakes"
    before = state(blender)
    (tmp_path / "copy").mkdir()
    copy = importlib.import_module("buzz_gltf_test.blender.ui")._save_copy(tmp_path / "copy")
    assert (nodes.bake_directory, state(blender)) == ("//bakes", before)
    blender.ops.wm.open_mainfile(filepath=str(copy))
    assert Path(blender.data.objects["Chosen"].modifiers["Nodes"].bake_directory) == tmp_path / "bakes"


def test_images_that_are_not_saved_are_named(blender, shot, tmp_path, capfd):
    image = blender.data.images.new("Paint", 4, 4)
    image.pixels[0] = 0.5
    assert blender.ops.export_scene.buzz_gltf(filepath=str(tmp_path / "o" / "anim.gltf")) == {"FINISHED"}
    assert "Paint: image that is painted but not saved" in capfd.readouterr().out


def test_missing_converter_is_one_clear_error(blender, shot, tmp_path, monkeypatch):
    monkeypatch.setenv("BUZZ_CONVERT", "")
    monkeypatch.setenv("PATH", str(tmp_path))
    blender.context.scene.buzz.output = str(tmp_path / "out")
    with pytest.raises(RuntimeError, match="set its path in Preferences"):
        blender.ops.render.buzz_export(convert=True)


def test_blender_installs_and_enables_it(package, tmp_path):
    """Through Blender's own installer, in a Blender with its own settings folder; then an export under its real name."""
    code = f"""
import bpy
bpy.ops.extensions.package_install_files(filepath={str(package / "buzz.zip")!r}, repo="user_default", enable_on_install=True)
assert "bl_ext.user_default.buzz_gltf" in bpy.context.preferences.addons
assert bpy.ops.export_scene.buzz_gltf(filepath={str(tmp_path / "x.gltf")!r}) == {{"FINISHED"}}
"""
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path)}, timeout=120, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "x.gltf").is_file()


def test_files_are_trusted_as_they_are_in_the_window():
    from exporters.blender.background import export_command

    inside = export_command("blender", Path("a.blend"), Path("o.gltf"), [], trusted=True)
    assert inside.index("--enable-autoexec") < inside.index("a.blend"), "Blender reads its arguments in order"
    assert "--scripts" in export_command("", Path("a.blend"), Path("o.gltf"), [], trusted=True)
    assert not {"--enable-autoexec", "--scripts"} & {*export_command("blender", Path("a"), Path("o"), []), *export_command("", Path("a"), Path("o"), [])}


def test_progress_is_parsed_and_errors_are_kept():
    from exporters.blender.background import Task

    code = "print('frame 12: inferred from 8, 3.1 % of pixels traced; 5/20, 80 % of rays saved, 1 second left'); print('warning: A: b: c')"
    task = Task([("rendering", [sys.executable, "-c", code])])
    task.wait()
    assert (task.done, task.error, task.warnings) == (True, None, ["A: b: c"])
    assert task.text.startswith("frame 12")
    task = Task([("rendering", [sys.executable, "-c", "import sys; print('error: no such file'); sys.exit(3)"]), ("never", ["x"])])
    task.wait()
    assert task.error == "no such file"


def test_what_buzz_convert_says_is_kept():
    from exporters.blender.background import Task

    code = "import sys; print('buzz-convert: warning: /materials/3: sheen: left out'); print('buzz-convert: a.gltf: cannot be read'); sys.exit(3)"
    task = Task([("rendering", [sys.executable, "-c", code])])
    task.wait()
    assert (task.error, task.warnings) == ("a.gltf: cannot be read", ["/materials/3: sheen: left out"])


def test_an_export_that_fails_leaves_nothing(tmp_path):
    from exporters.common.document import write_whole
    from exporters.common.report import OutputError

    write_whole(tmp_path / "a.bin", b"one")
    (tmp_path / "folder.bin" / "kept").mkdir(parents=True)
    with pytest.raises(OutputError):
        write_whole(tmp_path / "folder.bin", b"two")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.bin", "folder.bin"]


def test_cancel_ends_the_process():
    from exporters.blender.background import Task

    task = Task([("sleeping", [sys.executable, "-c", "import time; time.sleep(60)"])])
    task.poll()
    started = time.monotonic()
    task.cancel()
    assert time.monotonic() - started < 10
    assert task.error == "cancelled"
    assert not task.poll()
    assert os.getpid() > 0
