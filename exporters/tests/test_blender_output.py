"""Where an export's files go: what is not its own stays, its own of before are replaced, and what fails leaves all as it was."""

from __future__ import annotations

import os
import resource

import numpy as np
import pytest
from exporters.common.report import OutputError


def files(folder) -> dict[str, bytes]:
    """All files below a folder."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture
def scene(blender, tmp_path):
    """A square with an image, under a sky with an image; their files are called as those of an export may be."""
    import blender_scene as b

    b.camera()
    ob = b.plane("Square", size=2)
    ob.data.uv_layers.new(name="UVMap")
    made, shader = b.material()
    ob.data.materials.append(made)
    world = blender.data.worlds.new("World")
    blender.context.scene.world = world
    world.use_nodes = True
    for name, kind, socket in (
        ("hero_textures/wood.png", "TexImage", shader.inputs["Base Color"]),
        ("hero_world.hdr", "TexEnvironment", world.node_tree.nodes["Background"].inputs["Color"]),
    ):
        image = blender.data.images.new("image", 8, 4, float_buffer=name.endswith("hdr"))
        image.filepath_raw, image.file_format = str(tmp_path / "shot" / name), "HDR" if name.endswith("hdr") else "PNG"
        image.save()
        node = socket.id_data.nodes.new(f"ShaderNode{kind}")
        node.image = blender.data.images.load(image.filepath_raw)
        socket.id_data.links.new(node.outputs["Color"], socket)
    return tmp_path / "shot"


def test_files_of_the_artist_stay(blender, scene, export):
    (scene / "hero_textures" / "wood.psd").write_bytes(b"the only one")
    (scene / "hero.bin").write_bytes(b"another program's")
    before = files(scene)
    gltf = export("shot/hero.gltf")
    after = files(scene)
    assert before.items() <= after.items()
    new = ["hero-2.bin", "hero-2_textures/wood.png", "hero-2_world.hdr", "hero.gltf"]
    assert sorted(set(after) - set(before)) == new
    assert (gltf.root["images"][0]["uri"], gltf.buzz["world"]["image"]) == (new[1], new[2])
    export("shot/hero.gltf")
    assert set(files(scene)) == set(after)


@pytest.mark.parametrize("name", ["anim.gltf", "anim.glb"])
def test_files_of_an_earlier_export_are_replaced(blender, scene, export, tmp_path, name):
    export(f"out/{name}")
    first = set(files(tmp_path / "out"))
    export(f"out/{name}")
    assert set(files(tmp_path / "out")) == first
    blender.context.scene.world = None
    blender.data.objects["Square"].data.materials.clear()
    export(f"out/{name}")
    assert {p.name for p in (tmp_path / "out").iterdir()} == {name} | ({"anim.bin"} if name.endswith(".gltf") else set())


def test_a_file_among_those_of_an_earlier_export_stays(blender, scene, export, tmp_path):
    out = tmp_path / "out"
    export("out/anim.gltf")
    (out / "anim_textures" / "notes.txt").write_bytes(b"keep")
    (out / "anim.gltf.txt").write_bytes(b"keep")
    for _ in range(2):
        export("out/anim.gltf")
        assert set(files(out)) == {
            "anim.gltf", "anim.gltf.txt", "anim-2.bin", "anim-2_textures/wood.png", "anim-2_world.hdr", "anim_textures/notes.txt",
        }  # fmt: skip


def test_a_folder_in_the_way_is_refused(blender, scene, export, tmp_path):
    (tmp_path / "out" / "anim.gltf").mkdir(parents=True)
    with pytest.raises(OutputError, match=r"anim\.gltf: cannot be written \(Is a directory\)"):
        export("out/anim.gltf")
    assert files(tmp_path / "out") == {}


@pytest.mark.parametrize("again", [False, True])
def test_what_cannot_be_put_in_place_changes_nothing(blender, scene, export, tmp_path, monkeypatch, again):
    if again:
        export("out/anim.gltf")
    before = files(tmp_path / "out")
    replace = os.replace

    def fail(source, target):
        if str(target).endswith("out/anim.gltf"):
            raise PermissionError(13, "Permission denied")
        replace(source, target)

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OutputError, match=r"out/anim\.gltf: cannot be written \(Permission denied\)"):
        export("out/anim.gltf")
    assert files(tmp_path / "out") == before
    assert again or not (tmp_path / "out").exists()


def test_what_comes_into_the_way_meanwhile_stays(blender, scene, export, tmp_path, monkeypatch):
    from exporters.blender import world

    out = tmp_path / "out"
    made = world.export_world

    def export_world(*arguments):
        (out / "anim_world.hdr").write_bytes(b"saved by the artist")
        return made(*arguments)

    monkeypatch.setattr(world, "export_world", export_world)
    with pytest.raises(OutputError, match=r"anim_world\.hdr has come there meanwhile"):
        export("out/anim.gltf")
    assert files(out) == {"anim_world.hdr": b"saved by the artist"}


@pytest.mark.parametrize("what", ["mesh", "texture", "image sky", "sky"])
def test_a_full_disk_is_one_line(blender, export, tmp_path, monkeypatch, what):
    import blender_scene as b

    b.camera()
    owner = b.material()[0] if what in ("mesh", "texture") else blender.data.worlds.new("World")
    owner.use_nodes = True
    if what == "mesh":
        blender.ops.mesh.primitive_grid_add(x_subdivisions=100, y_subdivisions=100)
    elif what == "texture":
        b.plane().data.materials.append(owner)
        paint(blender, owner.node_tree, owner.node_tree.nodes["Principled BSDF"].inputs["Base Color"])
    else:
        blender.context.scene.world = owner
        monkeypatch.setattr("exporters.blender.world._BAKED_WIDTH", 256)
        paint(blender, owner.node_tree, owner.node_tree.nodes["Background"].inputs["Color"], image=what == "image sky")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, hard))
    try:
        with pytest.raises(OutputError, match=r"out/anim\.gltf: cannot be written \((File too large|no room for its textures in .*)\)"):
            export("out/anim.gltf", bake=256)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not (tmp_path / "out").exists()


def paint(blender, tree, socket, image=False):
    """Colours that no file holds in few bytes."""
    if image:
        node = tree.nodes.new("ShaderNodeTexEnvironment")
        node.image = blender.data.images.new("sky", 256, 128, float_buffer=True)
        node.image.pixels.foreach_set(np.random.default_rng(1).random(256 * 128 * 4, dtype=np.float32))
    else:
        node, place = tree.nodes.new("ShaderNodeTexWhiteNoise"), tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(place.outputs["Generated"], node.inputs["Vector"])
    tree.links.new(node.outputs["Color"], socket)
