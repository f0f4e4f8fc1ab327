"""Mix Shaders of Transparent and something: the same as the alpha of a Principled BSDF."""

from __future__ import annotations

import numpy as np
import pytest
from test_blender_materials import cut_out, link, material_of, node, picture, texture


def alpha_of(blender, surface):
    """The alpha of an image with holes."""
    return cut_out(blender, surface, "Alpha")


def grey(blender, surface):
    """A black and white image."""
    return texture(blender, surface, image=picture(blender, (0.5, 0.5, 0.5), "Non-Color"))


def number(value):
    """A Value node."""

    def build(_, surface):
        made = node(surface, "Value")
        made.outputs[0].default_value = value
        return made.outputs[0]

    return build


def calculated(build, operation, *sides):
    """A Math node of something (None) and a constant."""

    def calculate(blender, surface):
        math = node(surface, "Math", operation=operation)
        for socket, side in zip(math.inputs, sides, strict=False):
            if side is None:
                link(build(blender, surface), socket)
            else:
                socket.default_value = side
        return math.outputs[0]

    return calculate


def invert(build):
    """An Invert Color node."""

    def inverted(blender, surface):
        made = node(surface, "Invert")
        made.inputs["Fac"].default_value = 1
        link(build(blender, surface), made.inputs["Color"])
        return made.outputs[0]

    return inverted


def rest(build):
    """One less something."""
    return calculated(build, "SUBTRACT", 1, None)


# The factor of the mixture, the place of Transparent in it, and the alpha.
CASES = {
    "alpha": (alpha_of, 1, alpha_of),
    "colour": (grey, 1, grey),
    "one less": (rest(alpha_of), 2, alpha_of),
    "invert": (invert(alpha_of), 2, alpha_of),
    "inverted colour": (invert(grey), 2, grey),
    "twice": (rest(invert(alpha_of)), 1, alpha_of),
    "clip": (calculated(alpha_of, "LESS_THAN", None, 0.25), 2, rest(calculated(alpha_of, "LESS_THAN", None, 0.25))),
    "value": (number(0.25), 1, number(0.25)),
    "value of the other": (number(0.25), 2, number(0.75)),
    "rest of a value": (rest(number(0.25)), 1, number(0.75)),
    "unlinked": (0.25, 2, number(0.75)),
    "opaque": (1.0, 1, number(1.0)),
}


def mix(surface, factor, place, *, shader=None):
    """A mixture of a shader with Transparent, before the material output."""
    made = node(surface, "MixShader")
    link((shader or surface).outputs[0], made.inputs[3 - place])
    link(node(surface, "BsdfTransparent").outputs[0], made.inputs[place])
    if isinstance(factor, float):
        made.inputs[0].default_value = factor
    else:
        link(factor, made.inputs[0])
    link(made.outputs[0], surface.id_data.get_output_node("ALL").inputs["Surface"])
    return made


def content(gltf):
    """What is compared: the material, its images, its losses."""
    return material_of(gltf), [image["name"].split(".")[0] for image in gltf.root.get("images", [])], gltf.lost_features("Grey")


@pytest.mark.parametrize("case", CASES)
def test_a_mixture_with_transparent_is_an_alpha(blender, surface, export, case):
    factor, place, alpha = CASES[case]
    link(texture(blender, surface), surface.inputs["Base Color"])
    surface.inputs["Metallic"].default_value = 0.25
    end = surface.outputs[0].links[0].to_socket
    mix(surface, factor if isinstance(factor, float) else factor(blender, surface), place)
    mixed = content(export("mixed.gltf", bake=0))
    link(surface.outputs[0], end)
    link(alpha(blender, surface), surface.inputs["Alpha"])
    plain = content(export("plain.gltf", bake=0))
    assert mixed == plain
    assert plain[2] == [] and plain[0].get("alphaMode", "OPAQUE") == {"opaque": "OPAQUE", "clip": "MASK"}.get(case, "BLEND")


def test_a_turned_mixture_is_baked(blender, surface, export):
    """Nothing in glTF is one less an image."""
    mix(surface, texture(blender, surface, image=picture(blender, (0.2, 0.2, 0.2), "Non-Color")), 2)
    gltf = export(bake=16)
    assert not gltf.lost.items
    image = pixels_of(blender, gltf)
    assert np.median(image[..., 3]) == pytest.approx(0.8, abs=0.01)


def pixels_of(blender, gltf) -> np.ndarray:
    """The pixels of the base colour's image."""
    index = material_of(gltf)["pbrMetallicRoughness"]["baseColorTexture"]["index"]
    uri = gltf.root["images"][gltf.root["textures"][index]["source"]]["uri"]
    image = blender.data.images.load(str(gltf.path.parent / uri))
    return np.array(image.pixels).reshape(*image.size, 4)


def test_a_mixture_multiplies_the_alpha_that_is_there(blender, surface, export):
    """Two mixtures, one in the other, and an alpha."""
    surface.inputs["Alpha"].default_value = 0.5
    inner = mix(surface, 0.5, 1)
    mix(surface, alpha_of(blender, surface), 1, shader=inner)
    gltf = export(bake=0)
    assert not gltf.lost.items
    assert material_of(gltf)["pbrMetallicRoughness"]["baseColorFactor"][3] == pytest.approx(0.25)
    assert "baseColorTexture" in material_of(gltf)["pbrMetallicRoughness"]


@pytest.mark.parametrize("kind", ["BsdfDiffuse", "Emission"])
def test_other_shaders_have_an_alpha_too(blender, surface, export, kind):
    mix(surface, 0.25, 1, shader=node(surface, kind))
    gltf = export(bake=0)
    assert not gltf.lost.items
    assert material_of(gltf)["pbrMetallicRoughness"]["baseColorFactor"][3] == 0.25
    assert ("emissiveFactor" in material_of(gltf)) == (kind == "Emission")


@pytest.mark.parametrize(("kind", "output"), [("LightPath", "Is Shadow Ray"), ("NewGeometry", "Backfacing"), ("Fresnel", "Fac")])
def test_what_differs_between_rays_is_no_alpha(blender, surface, export, kind, output):
    """Such as glass without a shadow: it is named, and seen."""
    mix(surface, node(surface, kind).outputs[output], 2)
    gltf = export(bake=16)
    assert gltf.lost_features("Grey") == ["Mix Shader shader"]
    assert "alphaMode" not in material_of(gltf)


def test_a_coloured_transparent_is_no_alpha(blender, surface, export):
    made = mix(surface, 0.5, 1)
    made.inputs[1].links[0].from_node.inputs["Color"].default_value = (1, 0, 0, 1)
    assert export().lost_features("Grey") == ["Mix Shader shader"]


@pytest.mark.parametrize(("kinds", "colour"), [(("Transparent", "Diffuse", "Anisotropic"), [1, 0.25, 0, 1]), (("Toon", "Sheen"), [0.8, 0.8, 0.8, 1])])
def test_a_mixture_without_principled_is_its_first_plain_shader(blender, surface, export, kinds, colour):
    shaders = [node(surface, f"Bsdf{kind}") for kind in kinds]
    for shader in shaders:
        shader.inputs["Color"].default_value = (1, 1, 1, 1) if shader.type == "BSDF_TRANSPARENT" else (1, 0.25, 0, 1)
    shown = shaders[0].outputs[0]
    for shader in shaders[1:]:
        mix = node(surface, "AddShader")
        link(shown, mix.inputs[0])
        link(shader.outputs[0], mix.inputs[1])
        shown = mix.outputs[0]
    link(shown, surface.id_data.get_output_node("ALL").inputs["Surface"])
    surface.id_data.nodes.remove(surface)
    gltf = export()
    values = material_of(gltf)["pbrMetallicRoughness"]
    assert values["baseColorFactor"] == pytest.approx(colour)
    assert values["metallicFactor"] == 0
    assert gltf.lost_features("Grey") == ["Add Shader shader"]
