"""Images of materials as files, materials of libraries, working spaces."""

from __future__ import annotations

import re
from urllib.parse import unquote

import numpy as np
import pytest
from blender_nodes import colour_of, link, material_of, node, picture, texture


@pytest.mark.parametrize("suffix", [".gltf", ".glb"])
@pytest.mark.parametrize("name", ["maps/wood", "../../evil", 'a:b*"c"', "ä" * 62])
def test_images_of_any_name_are_files_beside_the_gltf(blender, surface, export, tmp_path, name, suffix):
    image = picture(blender)
    image.name = name
    link(texture(blender, surface, image=image), surface.inputs["Base Color"])
    gltf = export(f"in/side/anim{suffix}")
    assert [image["name"] for image in gltf.root["images"]] == [name]
    written = {str(p.relative_to(gltf.path.parent)) for p in tmp_path.rglob("*.png")}
    assert written == {unquote(image["uri"]) for image in gltf.root["images"] if "uri" in image}
    assert all(re.fullmatch(r'anim_textures/[^/:*"]+', path) for path in written)


def test_baked_images_of_any_material_are_files(blender, surface, export):
    blender.data.materials["Grey"].name = "Wood/Oak"
    link(node(surface, "TexNoise").outputs["Color"], surface.inputs["Base Color"])
    image = export(bake=16).root["images"][0]
    assert (image["name"], image["uri"]) == ("Wood/Oak-BaseColor", "anim_textures/Wood_Oak-BaseColor.png")


def test_a_packed_image_forgets_where_it_was(blender, surface, export):
    image = picture(blender)
    image.filepath_raw = "C:\\maps\\wood.png"
    link(texture(blender, surface, image=image), surface.inputs["Base Color"])
    image.source = "FILE"
    assert [image["uri"] for image in export().root["images"]] == ["anim_textures/wood.png"]


def test_materials_of_a_library(blender, surface, export, tmp_path):
    """An image whose name is no file name, and a colour that is baked, in a node group."""
    import blender_scene as b

    image = picture(blender, (1, 0, 0))
    image.name = "maps/wood"
    link(texture(blender, surface, image=image), surface.inputs["Base Color"])
    group = blender.data.node_groups.new("Red", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    inner = group.nodes.new("ShaderNodeTexImage")
    inner.image = image
    gamma = group.nodes.new("ShaderNodeGamma")
    group.links.new(inner.outputs["Color"], gamma.inputs["Color"])
    group.links.new(gamma.outputs["Color"], group.nodes.new("NodeGroupOutput").inputs[0])
    _, other = b.material("Other")
    link(node(other, "Group", node_tree=group).outputs[0], other.inputs["Base Color"])
    second = b.plane("Second", size=1)
    second.data.materials.append(blender.data.materials["Other"])
    blender.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    blender.ops.wm.read_factory_settings(use_empty=True)
    with blender.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
        wanted.objects = ["Square", "Second"]
    for ob in wanted.objects:
        b.link(ob)
    gltf = export(bake=16)
    assert {image["name"]: image["uri"] for image in gltf.root["images"]} == {
        "maps/wood": "anim_textures/maps_wood.png",
        "Other-BaseColor": "anim_textures/Other-BaseColor.png",
    }
    assert {material["name"] for material in gltf.root["materials"]} == {"Grey", "Other"}
    for material in gltf.root["materials"]:
        np.testing.assert_allclose(colour_of(blender, gltf, material["pbrMetallicRoughness"]["baseColorTexture"]), (1, 0, 0), atol=0.01)


@pytest.mark.parametrize("animated", [False, True])
def test_colours_of_another_working_space_are_converted(blender, surface, export, animated):
    import blender_scene as b

    if not hasattr(blender.data, "colorspace"):
        pytest.skip("only Blender 5.0 and later have working spaces")
    lamp, red = blender.data.lights["Light"], [1, 0.25, 0]
    lamp.color = red
    surface.inputs["Base Color"].default_value = (*red, 1)
    world = blender.context.scene.world = blender.data.worlds.new("World")
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (*red, 1)
    blender.ops.wm.set_working_color_space(working_space="Linear Rec.2020", convert_colors=True)
    if animated:
        b.key(lamp, "color", {1: lamp.color[:], 2: (0, 0, 0)})
        b.key(surface.inputs["Base Color"], "default_value", {1: (1, 1, 1, 1), 2: (0, 0, 0, 1)})
    gltf = export()
    if animated:
        assert gltf.lost_features("Light") == ["animated colours in Linear Rec.2020"]
        assert gltf.lost_features("Grey") == ["animated colours in Linear Rec.2020", "animated material"]
        return
    assert gltf.light("Light")[1]["color"] == pytest.approx(red, abs=1e-3)
    assert material_of(gltf)["pbrMetallicRoughness"]["baseColorFactor"][:3] == pytest.approx(red, abs=1e-3)
    assert gltf.buzz["world"]["color"] == pytest.approx(red, abs=1e-3)
