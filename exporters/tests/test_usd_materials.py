"""USD materials: preview surfaces, their textures, and what is not carried."""

from __future__ import annotations

import io
import math
import zipfile

import numpy as np
import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")
import usd_scene as u
from gltf_reader import primitive
from PIL import Image
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils


def test_preview_surface(usd_convert):
    made = u.stage()
    u.camera(made)
    prim = u.quad(made, "/World/Card")
    prim.CreateDoubleSidedAttr(True)
    u.bind(
        prim,
        u.preview(
            made, "/World/M", diffuseColor=(0.1, 0.2, 0.3), metallic=0.5, roughness=0.25, ior=1.8, clearcoat=1.0, emissiveColor=(4.0, 2.0, 0.0), opacity=0.5
        ),
    )
    material = usd_convert(made).root["materials"][0]
    pbr = material["pbrMetallicRoughness"]
    assert pbr["baseColorFactor"] == pytest.approx([0.1, 0.2, 0.3, 0.5])
    assert (pbr["metallicFactor"], pbr["roughnessFactor"]) == (0.5, 0.25)
    assert (material["alphaMode"], material["doubleSided"]) == ("BLEND", True)
    assert material["extensions"]["KHR_materials_ior"]["ior"] == pytest.approx(1.8)
    assert material["extensions"]["KHR_materials_clearcoat"]["clearcoatFactor"] == 1
    assert material["emissiveFactor"] == [1, 0.5, 0]
    assert material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] == 4


def test_bindings_for_final_pictures(usd_convert):
    """On a mesh and a subset: purpose full wins, and is enough alone; preview is not for final pictures."""
    made = u.stage()
    u.camera(made)
    red, green = u.preview(made, "/World/Red"), u.preview(made, "/World/Green")
    for name, bindings in {"Both": {"": green, "full": red}, "Full": {"full": red}, "All": {"": red, "preview": green}}.items():
        api = UsdShade.MaterialBindingAPI.Apply(u.quad(made, f"/World/{name}").GetPrim())
        for purpose, material in bindings.items():
            api.Bind(material, UsdShade.Tokens.fallbackStrength, purpose)
    box = u.cube(made, "/World/Box")
    subset = UsdGeom.Subset.CreateGeomSubset(box, "Lid", "face", [4, 5], "materialBind")
    UsdShade.MaterialBindingAPI.Apply(subset.GetPrim()).Bind(red, UsdShade.Tokens.fallbackStrength, "full")
    gltf = usd_convert(made)

    def bound(name):
        mesh = gltf.root["meshes"][gltf.root["nodes"][gltf.node(name)]["mesh"]]
        return {gltf.root["materials"][p["material"]]["name"] for p in mesh["primitives"]}

    assert [bound(n) for n in ("Both", "Full", "All")] == [{"Red"}] * 3
    assert bound("Box") == {"Red", "displayColor"}


def test_instances_bound_to_other_materials_for_final_pictures(usd_convert, tmp_path):
    """Two instances of one prototype that differ only in what is bound for purpose full."""
    asset = Usd.Stage.CreateNew(str(tmp_path / "asset.usda"))
    asset.SetDefaultPrim(UsdGeom.Xform.Define(asset, "/Asset").GetPrim())
    u.quad(asset, "/Asset/Geo")
    asset.Save()
    made = u.stage()
    u.camera(made)
    for name in ("Red", "Green"):
        prim = UsdGeom.Xform.Define(made, f"/World/I{name}").GetPrim()
        prim.GetReferences().AddReference("asset.usda")
        prim.SetInstanceable(True)
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(u.preview(made, f"/World/{name}"), UsdShade.Tokens.fallbackStrength, "full")
    gltf = usd_convert(made)
    meshes = [gltf.root["meshes"][n["mesh"]] for n in gltf.root["nodes"] if n["name"] == "Geo"]
    assert {gltf.root["materials"][m["primitives"][0]["material"]]["name"] for m in meshes} == {"Red", "Green"}


def test_inherited_display_colour_of_shapes(usd_convert):
    made = u.stage()
    u.camera(made)
    group = UsdGeom.Xform.Define(made, "/World/Group")
    UsdGeom.PrimvarsAPI(group).CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, "constant").Set([(1, 0, 0)])
    UsdGeom.Sphere.Define(made, "/World/Group/Ball")
    many = UsdGeom.Sphere.Define(made, "/World/Many")
    many.CreateDisplayColorPrimvar("vertex").Set([(0, 1, 0), (0, 0, 1)])
    gltf = usd_convert(made)
    material = gltf.root["materials"][primitive(gltf, "Ball")[0]["material"]]
    assert material["pbrMetallicRoughness"]["baseColorFactor"] == [1, 0, 0, 1]
    assert gltf.lost_features("/World/Many") == ["displayColor that varies over a shape"]


def test_animated_primvars_are_named_where_they_are_seen(usd_convert, tmp_path):
    Image.new("RGB", (2, 2)).save(tmp_path / "t.png")
    made = u.stage()
    u.camera(made)
    material = u.preview(made, "/World/M")
    u.texture(made, material, "diffuseColor", "t.png")
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    for name, bound in (("Moving", True), ("Same", True), ("Unread", False)):
        prim = u.quad(made, f"/World/{name}")
        u.uv(prim, corners)
        primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar("st")
        for frame in (1, 5):
            primvar.Set([Gf.Vec2f(s + (frame if name != "Same" else 0), t) for s, t in corners], frame)
        colour = prim.CreateDisplayColorPrimvar("constant")
        for frame in (1, 5):
            colour.Set([(frame / 5, 0, 0)], frame)
        if bound:
            u.bind(prim, material)
    gltf = usd_convert(made)
    assert gltf.lost_features("/World/Moving") == ["animated primvar st"]
    assert gltf.lost_features("/World/Same") == []
    assert gltf.lost_features("/World/Unread") == ["animated primvar displayColor"]


def test_opacity_threshold_is_a_mask(usd_convert):
    made = u.stage()
    u.camera(made)
    prim = u.quad(made, "/World/Card")
    u.bind(prim, u.preview(made, "/World/M", opacity=0.5, opacityThreshold=0.25))
    material = usd_convert(made).root["materials"][0]
    assert (material["alphaMode"], material["alphaCutoff"]) == ("MASK", 0.25)


def test_textures_go_into_gltfs_channels(usd_convert, tmp_path):
    """Metallic from one image's red, roughness from another's alpha: packed into blue and green."""
    Image.new("RGBA", (2, 2), (51, 0, 0, 255)).save(tmp_path / "metal.png")
    Image.new("RGBA", (4, 4), (0, 0, 0, 102)).save(tmp_path / "rough.png")
    made = u.stage()
    u.camera(made)
    prim = u.quad(made, "/World/Card")
    u.uv(prim, [(0, 0), (1, 0), (1, 1), (0, 1)])
    material = u.preview(made, "/World/M")
    u.texture(made, material, "metallic", "metal.png", "r")
    u.texture(made, material, "roughness", "rough.png", "a", wrapS="clamp")
    u.bind(prim, material)
    gltf = usd_convert(made)
    pbr = gltf.root["materials"][0]["pbrMetallicRoughness"]
    texture = gltf.root["textures"][pbr["metallicRoughnessTexture"]["index"]]
    image = Image.open(gltf.path.parent / gltf.root["images"][texture["source"]]["uri"])
    assert image.size == (4, 4)
    assert image.convert("RGB").getpixel((1, 1))[1:] == (102, 51)


def test_texture_transform_turns_over(usd_convert, tmp_path):
    """UsdTransform2d and KHR_texture_transform send a point to the same texel, v counted from the other end."""
    Image.new("RGB", (2, 2)).save(tmp_path / "t.png")
    made = u.stage()
    u.camera(made)
    prim = u.quad(made, "/World/Card")
    u.uv(prim, [(0, 0), (1, 0), (1, 1), (0, 1)])
    material = u.preview(made, "/World/M")
    node = u.texture(made, material, "diffuseColor", "t.png")
    turn = UsdShade.Shader.Define(made, "/World/M/Turn")
    turn.CreateIdAttr("UsdTransform2d")
    turn.CreateInput("rotation", Sdf.ValueTypeNames.Float).Set(30.0)
    turn.CreateInput("scale", Sdf.ValueTypeNames.Float2).Set(Gf.Vec2f(2, 3))
    turn.CreateInput("translation", Sdf.ValueTypeNames.Float2).Set(Gf.Vec2f(0.25, 0.5))
    reader = UsdShade.Shader(made.GetPrimAtPath("/World/M/diffuseColorReader"))
    turn.CreateInput("in", Sdf.ValueTypeNames.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
    node.GetInput("st").ConnectToSource(turn.ConnectableAPI(), "result")
    u.bind(prim, material)
    info = usd_convert(made).root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"]
    a = math.radians(30)
    for s, t in ((0.1, 0.2), (0.7, 0.4)):
        want = (2 * s * math.cos(a) - 3 * t * math.sin(a) + 0.25, 2 * s * math.sin(a) + 3 * t * math.cos(a) + 0.5)
        # KHR_texture_transform: offset + rotation * scale * uv, with rotation's columns (cos, -sin), (sin, cos) for v down.
        r, (x, y) = info["rotation"], (info["scale"][0] * s, info["scale"][1] * (1 - t))
        got = (info["offset"][0] + math.cos(r) * x + math.sin(r) * y, info["offset"][1] - math.sin(r) * x + math.cos(r) * y)
        assert got == (pytest.approx(want[0], abs=1e-6), pytest.approx(1 - want[1], abs=1e-6))


def test_usdz_with_textures(usd_convert, tmp_path):
    Image.new("RGB", (3, 3), (9, 8, 7)).save(tmp_path / "inside.png")
    made = u.stage()
    u.camera(made)
    prim = u.quad(made, "/World/Card")
    u.uv(prim, [(0, 0), (1, 0), (1, 1), (0, 1)])
    material = u.preview(made, "/World/M")
    u.texture(made, material, "diffuseColor", "inside.png")
    u.bind(prim, material)
    made.GetRootLayer().Export(str(tmp_path / "s.usda"))
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "s.usda"), str(tmp_path / "s.usdz"))
    assert any(n.endswith("inside.png") for n in zipfile.ZipFile(tmp_path / "s.usdz").namelist())
    (tmp_path / "inside.png").unlink()
    gltf = usd_convert(tmp_path / "s.usdz", "out.glb")
    view = gltf.root["bufferViews"][gltf.root["images"][0]["bufferView"]]
    start = view.get("byteOffset", 0)
    image = Image.open(io.BytesIO(gltf._binary[start : start + view["byteLength"]]))
    assert image.getpixel((1, 1)) == (9, 8, 7)


def test_what_is_not_carried_is_named(usd_convert):
    made = u.stage()
    u.camera(made)
    made.DefinePrim("/World/Hair", "BasisCurves")
    made.DefinePrim("/World/Smoke", "Volume")
    UsdGeom.Mesh.Define(made, "/World/Empty")
    broken = u.quad(made, "/World/Broken")
    broken.GetFaceVertexIndicesAttr().Set([0, 1, 2, 99])
    gltf = usd_convert(made)
    assert gltf.lost_features("/World/Hair") == ["BasisCurves"]
    assert gltf.lost_features("/World/Smoke") == ["Volume"]
    assert gltf.lost_features("/World/Empty") == ["mesh without faces"]
    assert "damaged mesh" in gltf.lost_features("/World/Broken")[0]


def test_display_colour_read_by_a_material(usd_convert):
    made = u.stage()
    u.camera(made)
    prim = u.quad(made, "/World/Card")
    prim.CreateDisplayColorPrimvar("vertex").Set([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)])
    material = u.preview(made, "/World/M", roughness=0.25)
    reader = UsdShade.Shader.Define(made, "/World/M/Reader")
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
    surface = UsdShade.Shader(made.GetPrimAtPath("/World/M/Surface"))
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(reader.ConnectableAPI(), "result")
    u.bind(prim, material)
    plain = u.quad(made, "/World/Plain")
    plain.CreateDisplayColorPrimvar("vertex").Set([(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)])
    u.bind(plain, u.preview(made, "/World/N"))
    gltf = usd_convert(made)
    assert len(np.unique(primitive(gltf, "Card")[1]["COLOR_0"], axis=0)) == 4
    assert "COLOR_0" not in primitive(gltf, "Plain")[1], "display colours do not tint a material that does not read them"


def surface(made, **inputs):
    """A card with a material, and its surface."""
    prim = u.quad(made, "/World/Card")
    u.uv(prim, [(0, 0), (1, 0), (1, 1), (0, 1)])
    material = u.preview(made, "/World/M", **inputs)
    u.bind(prim, material)
    return material, UsdShade.Shader(made.GetPrimAtPath("/World/M/Surface"))


@pytest.mark.parametrize("name", ["emissiveColor", "roughness", "specularColor"])
def test_vertex_colours_are_for_the_base_colour_only(usd_convert, name):
    """What else reads displayColor is named and has its default."""
    made = u.stage()
    u.camera(made)
    _, shader = surface(made)
    reader = UsdShade.Shader.Define(made, "/World/M/Reader")
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
    kind = Sdf.ValueTypeNames.Float if name == "roughness" else Sdf.ValueTypeNames.Color3f
    shader.CreateInput(name, kind).ConnectToSource(reader.ConnectableAPI(), "result")
    shader.CreateInput("useSpecularWorkflow", Sdf.ValueTypeNames.Int).Set(int(name == "specularColor"))
    gltf = usd_convert(made)
    assert any(f.startswith(f"{name} from") for f in gltf.lost_features("/World/M"))
    assert gltf.root["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] == 0.5
    assert gltf.root["materials"][0].get("emissiveFactor", [0, 0, 0]) == [0, 0, 0]


@pytest.mark.parametrize("name", ["ior", "opacityThreshold"])
def test_textures_where_only_a_constant_is_carried_are_named(usd_convert, tmp_path, name):
    Image.new("RGB", (2, 2)).save(tmp_path / "t.png")
    made = u.stage()
    u.camera(made)
    u.texture(made, surface(made)[0], name, "t.png", "r")
    assert usd_convert(made).lost_features("/World/M") == [f"{name} from a node"]


@pytest.mark.parametrize(("output", "lost"), [("rgba", []), ("out", ["diffuseColor from a UsdUVTexture node"])])
def test_outputs_that_the_specification_has_not(usd_convert, tmp_path, output, lost):
    """`rgba` is plain enough to be taken as `rgb`."""
    Image.new("RGB", (2, 2)).save(tmp_path / "t.png")
    made = u.stage()
    u.camera(made)
    u.texture(made, surface(made)[0], "diffuseColor", "t.png", output)
    gltf = usd_convert(made)
    assert gltf.lost_features("/World/M") == lost
    assert ("baseColorTexture" in gltf.root["materials"][0]["pbrMetallicRoughness"]) == (not lost)


def test_inputs_of_a_wrong_type_are_named(usd_convert):
    made = u.stage()
    u.camera(made)
    _, shader = surface(made)
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Float).Set(1.0)
    shader.CreateInput("roughness", Sdf.ValueTypeNames.Color3f).Set((1, 1, 1))
    gltf = usd_convert(made)
    assert gltf.lost_features("/World/M") == ["diffuseColor of a wrong type", "roughness of a wrong type"]
    pbr = gltf.root["materials"][0]["pbrMetallicRoughness"]
    assert (pbr["baseColorFactor"][0], pbr["roughnessFactor"]) == (0.18, 0.5)


def test_constant_displacement_is_named_where_it_displaces(usd_convert):
    made = u.stage()
    u.camera(made)
    material, shader = surface(made, displacement=0.3)
    assert not usd_convert(made).lost_features("/World/M")
    material.CreateDisplacementOutput().ConnectToSource(shader.ConnectableAPI(), "displacement")
    assert usd_convert(made).lost_features("/World/M") == ["displacement"]


def test_preview_surfaces_of_materialx(usd_convert):
    made = u.stage()
    u.camera(made)
    _, shader = surface(made, diffuseColor=(1.0, 0.5, 0.0), roughness=0.25)
    shader.CreateIdAttr("ND_UsdPreviewSurface_surfaceshader")
    gltf = usd_convert(made)
    pbr = gltf.root["materials"][0]["pbrMetallicRoughness"]
    assert (pbr["baseColorFactor"][:3], pbr["roughnessFactor"]) == ([1, 0.5, 0], 0.25)
    assert not gltf.lost_features("/World/M")


def test_materialx_numbers_are_those_gltf_may_have(usd_convert):
    made = u.stage()
    u.camera(made)
    _, shader = surface(made)
    shader.CreateIdAttr("ND_standard_surface_surfaceshader")
    shader.CreateInput("specular_roughness", Sdf.ValueTypeNames.Float).Set(1.5)
    assert usd_convert(made).root["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] == 1


def test_colours_over_one_are_named(usd_convert):
    made = u.stage()
    u.camera(made)
    u.bind(u.quad(made, "/World/Card"), u.preview(made, "/World/M", diffuseColor=(1.5, 0.5, 0.5)))
    gltf = usd_convert(made)
    assert gltf.root["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] == [1, 0.5, 0.5, 1]
    assert gltf.lost_features("/World/M") == ["diffuseColor over 1"]
