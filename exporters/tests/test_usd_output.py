"""What an export writes, replaces and leaves alone."""

from __future__ import annotations

import json
import os

import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")
import usd_scene as u
from exporters.common.report import InputError, OutputError
from exporters.usd import job
from PIL import Image
from pxr import UsdLux


@pytest.fixture
def shot(tmp_path):
    """Convert a textured card under a sky: shot("a.gltf") gives the JSON of a .gltf."""
    work = tmp_path / "work"
    work.mkdir()
    for name in ("t", "sky"):
        Image.new("RGB", (2, 2), (10, 20, 30)).save(work / f"{name}.png")

    def run(name="a.gltf", textured=True):
        made = u.stage(frames=None)
        u.camera(made)
        card = u.quad(made, "/World/Card")
        if textured:
            u.uv(card, [(0, 0), (1, 0), (1, 1), (0, 1)])
            material = u.preview(made, "/World/M")
            u.texture(made, material, "diffuseColor", "t.png")
            u.bind(card, material)
            UsdLux.DomeLight.Define(made, "/World/Sky").CreateTextureFileAttr("sky.png")
        made.GetRootLayer().Export(str(work / "s.usda"))
        target = tmp_path / "out" / name
        job.convert(work / "s.usda", target, job.Options())
        return json.loads(target.read_text()) if target.suffix == ".gltf" else None

    return run


def files(folder):
    """All files below a folder with their bytes."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_files_of_others_are_left_alone(shot, tmp_path):
    out = tmp_path / "out"
    (out / "a_textures").mkdir(parents=True)
    others = {"a_textures/t_0.png": b"painted", "a_world.png": b"a sky", "a.bin": b"a buffer", "a_textures/notes.txt": b"notes"}
    for name, data in others.items():
        (out / name).write_bytes(data)
    root = shot()
    first = files(out)
    assert {k: first[k] for k in others} == others
    names = [root["images"][0]["uri"], root["scenes"][0]["extras"]["buzz"]["world"]["image"], root["buffers"][0]["uri"]]
    assert names == ["a_textures/t_0-2.png", "a_world-2.png", "a-2.bin"]
    shot()
    assert files(out) == first
    shot(textured=False)
    assert set(files(out)) == {*others, "a.gltf", "a-2.bin"}


def test_what_is_no_longer_used_goes(shot, tmp_path):
    shot()
    assert set(files(tmp_path / "out")) == {"a.gltf", "a.bin", "a_world.png", "a_textures/t_0.png"}
    shot(textured=False)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["a.bin", "a.gltf"]


def test_a_glb_knows_its_sky_again(shot, tmp_path):
    for _ in range(2):
        shot("a.glb")
        assert set(files(tmp_path / "out")) == {"a.glb", "a_world.png"}
    shot("a.gltf")
    assert "a_world-2.png" in files(tmp_path / "out")


@pytest.mark.parametrize("content", ['{"asset":{"version":"2.0","generator":"Another"}}', '{"asset":{"version":"2.0"}}', "[]", ""])
@pytest.mark.parametrize("name", ["a.gltf", "a.glb"])
def test_a_target_of_another_program_is_replaced_without_what_is_beside_it(shot, tmp_path, name, content):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).write_text(content)
    (tmp_path / "out" / "a.bin").write_text("theirs")
    shot(name)
    written = files(tmp_path / "out")
    assert written["a.bin"] == b"theirs" and written[name] != content.encode()
    assert name == "a.glb" or "a-2.bin" in written


def test_what_the_exporter_for_blender_made_is_replaced(shot, tmp_path):
    made = {"images": [{"uri": "a_textures/Wood.png"}], "buffers": [{"uri": "a.bin"}], "asset": {"version": "2.0", "generator": "Khronos"}}
    made["scenes"] = [{"extras": {"buzz": {"generator": "Buzz exporter for Blender 1.0.0"}}}]
    (tmp_path / "out" / "a_textures").mkdir(parents=True)
    (tmp_path / "out" / "a.gltf").write_text(json.dumps(made))
    for name in ("a_textures/Wood.png", "a.bin"):
        (tmp_path / "out" / name).write_bytes(b"old")
    shot()
    assert set(files(tmp_path / "out")) == {"a.gltf", "a.bin", "a_world.png", "a_textures/t_0.png"}


def test_what_a_file_refers_to_elsewhere_stays(shot, tmp_path):
    """Somebody has pointed our file at an image of his own."""
    root = shot()
    mine = tmp_path / "mine.png"
    mine.write_bytes(b"mine")
    root["images"] += [{"uri": "../mine.png"}, {"uri": "a_textures/../../mine.png"}, {"uri": "data:image/png;base64,"}, {}]
    (tmp_path / "out" / "a.gltf").write_text(json.dumps(root))
    shot(textured=False)
    assert mine.read_bytes() == b"mine"


def test_a_folder_in_place_of_our_file_stays(shot, tmp_path):
    shot()
    (tmp_path / "out" / "a.bin").unlink()
    (tmp_path / "out" / "a.bin").mkdir()
    (tmp_path / "out" / "a.bin" / "kept").write_text("mine")
    assert shot()["buffers"][0]["uri"] == "a-2.bin"
    assert (tmp_path / "out" / "a.bin" / "kept").read_text() == "mine"


def test_a_failed_export_leaves_nothing(shot, tmp_path):
    (tmp_path / "out" / "a.gltf").mkdir(parents=True)
    with pytest.raises(OutputError, match=r"a\.gltf: cannot be written"):
        shot()
    assert [p.name for p in (tmp_path / "out").rglob("*")] == ["a.gltf"]
    (tmp_path / "out" / "b_textures").write_text("in the way")
    shot("b.gltf", textured=False)
    before = files(tmp_path / "out")
    with pytest.raises(OutputError, match="b_textures"):
        shot("b.gltf")
    assert files(tmp_path / "out") == before
    with pytest.raises(InputError):
        job.convert(tmp_path / "none.usda", tmp_path / "new" / "folder" / "a.gltf", job.Options())
    assert not (tmp_path / "new").exists()


def test_a_move_that_fails_is_undone(shot, tmp_path, monkeypatch):
    shot(textured=False)
    before, replace = files(tmp_path / "out"), os.replace

    def full(source, target):
        if str(target).endswith("a.gltf"):
            raise OSError(28, "No space left on device")
        replace(source, target)

    monkeypatch.setattr("exporters.usd.output.os.replace", full)
    with pytest.raises(OutputError, match="No space left"):
        shot()
    assert files(tmp_path / "out") == before
    assert not (tmp_path / "out" / "a_textures").exists()
