"""What of a USD stage is drawn, and where: visibility, purposes, instances, references."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")
import usd_scene as u
from pxr import Sdf, Usd, UsdGeom


def named(gltf, name):
    """All nodes with a name."""
    return [i for i, n in enumerate(gltf.root["nodes"]) if n["name"] == name]


def test_render_visibility(usd_convert):
    """It is heeded for purpose render, from the nearest prim that has it; elsewhere it means nothing and is named."""
    made = u.stage()
    u.camera(made)
    group = UsdGeom.Xform.Define(made, "/World/Group")
    UsdGeom.VisibilityAPI.Apply(group.GetPrim()).CreateRenderVisibilityAttr("invisible")
    for name, purpose in (("Hidden", "render"), ("Plain", "default")):
        UsdGeom.Imageable(u.quad(made, f"/World/Group/{name}")).CreatePurposeAttr(purpose)
    UsdGeom.VisibilityAPI.Apply(u.quad(made, "/World/Vain").GetPrim()).CreateRenderVisibilityAttr("invisible")
    gltf = usd_convert(made)
    names = {n["name"] for n in gltf.root["nodes"]}
    assert "Hidden" not in names
    assert {"Plain", "Vain"} <= names
    assert gltf.lost_features("/World/Vain") == ["renderVisibility without purpose render"]


def test_purpose_and_colours_of_point_instancers(usd_convert):
    made = u.stage()
    u.camera(made)
    for name, purpose in (("Guide", "guide"), ("Drawn", "default")):
        instancer = UsdGeom.PointInstancer.Define(made, f"/World/{name}")
        instancer.CreatePurposeAttr(purpose)
        u.quad(made, f"/World/{name}/Protos/{name}Card")
        instancer.CreatePrototypesRel().SetTargets([f"/World/{name}/Protos/{name}Card"])
        instancer.CreateProtoIndicesAttr([0, 0])
        instancer.CreatePositionsAttr([(0, 0, 0), (3, 0, 0)])
        UsdGeom.PrimvarsAPI(instancer).CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, "vertex").Set([(1, 0, 0), (0, 1, 0)])
    gltf = usd_convert(made)
    assert (len(named(gltf, "GuideCard")), len(named(gltf, "DrawnCard"))) == (0, 2)
    assert gltf.lost_features("/World/Drawn") == ["displayColor of each instance"]
    assert not gltf.lost_features("/World/Guide")


def test_visibility_and_purpose(usd_convert):
    made = u.stage()
    u.camera(made)
    group = UsdGeom.Xform.Define(made, "/World/Group")
    u.quad(made, "/World/Group/Blink")
    group.CreateVisibilityAttr().Set("inherited", 1)
    group.GetVisibilityAttr().Set("invisible", 3)
    for purpose in ("proxy", "guide", "render"):
        UsdGeom.Imageable(u.quad(made, f"/World/{purpose}")).CreatePurposeAttr(purpose)
    gltf = usd_convert(made)
    assert [gltf.visible(gltf.node("Blink"), f) for f in (1, 2, 3, 5)] == [True, True, False, False]
    names = {n["name"] for n in gltf.root["nodes"]}
    assert "render" in names
    assert not names & {"proxy", "guide"}


def test_point_instancer(usd_convert):
    made = u.stage(frames=(1, 2))
    u.camera(made)
    instancer = UsdGeom.PointInstancer.Define(made, "/World/Many")
    box = u.cube(made, "/World/Many/Protos/Box")
    UsdGeom.XformCommonAPI(box).SetScale((2, 2, 2))
    UsdGeom.Xform.Define(made, "/World/Many/Protos/Pair")
    UsdGeom.XformCommonAPI(u.quad(made, "/World/Many/Protos/Pair/Card")).SetTranslate((0, 1, 0))
    instancer.CreatePrototypesRel().SetTargets(["/World/Many/Protos/Box", "/World/Many/Protos/Pair"])
    instancer.CreateProtoIndicesAttr([0, 1, 0])
    instancer.CreateIdsAttr([7, 8, 9])
    instancer.CreatePositionsAttr().Set([(0, 0, 0), (5, 0, 0), (9, 0, 0)], 1)
    instancer.GetPositionsAttr().Set([(0, 0, 0), (5, 0, 3), (9, 0, 0)], 2)
    instancer.CreateInvisibleIdsAttr().Set([], 1)
    instancer.GetInvisibleIdsAttr().Set([9], 2)
    gltf = usd_convert(made)
    boxes, cards = named(gltf, "Box"), named(gltf, "Card")
    assert (len(boxes), len(cards)) == (2, 1)
    assert len({gltf.root["nodes"][n]["mesh"] for n in boxes}) == 1
    assert gltf.world(boxes[0], 1)[0, 0] == pytest.approx(2)
    np.testing.assert_allclose(gltf.world(cards[0], 2)[:3, 3], (5, 1, 3), atol=1e-6)
    assert [gltf.visible(boxes[1], f) for f in (1, 2)] == [True, False]


def test_point_instancer_whose_ids_are_alike(usd_convert):
    made = u.stage(frames=(1, 2))
    u.camera(made)
    instancer = UsdGeom.PointInstancer.Define(made, "/World/Many")
    u.cube(made, "/World/Many/Box")
    instancer.CreatePrototypesRel().SetTargets(["/World/Many/Box"])
    instancer.CreateProtoIndicesAttr([0, 0, 0])
    instancer.CreateIdsAttr([0, 0, 0])
    for frame in (1, 2):
        instancer.CreatePositionsAttr().Set([(x, 0, frame) for x in (0, 5, 9)], frame)
    gltf = usd_convert(made)
    for frame in (1, 2):
        places = [gltf.world(n, frame)[:3, 3] for n in named(gltf, "Box")]
        np.testing.assert_allclose(places, [(x, 0, frame) for x in (0, 5, 9)], atol=1e-6)


def test_native_instances_references_payloads_and_variants(usd_convert, tmp_path):
    asset = Usd.Stage.CreateNew(str(tmp_path / "asset.usda"))
    root = UsdGeom.Xform.Define(asset, "/Asset")
    asset.SetDefaultPrim(root.GetPrim())
    shapes = root.GetPrim().GetVariantSets().AddVariantSet("shape")
    for name in ("card", "box"):
        shapes.AddVariant(name)
        shapes.SetVariantSelection(name)
        with shapes.GetVariantEditContext():
            (u.quad if name == "card" else u.cube)(asset, "/Asset/Geo")
    shapes.SetVariantSelection("card")
    asset.Save()
    made = u.stage()
    u.camera(made)
    for i in range(3):
        prim = UsdGeom.Xform.Define(made, f"/World/I{i}")
        (prim.GetPrim().GetReferences().AddReference if i else prim.GetPrim().GetPayloads().AddPayload)("asset.usda")
        prim.GetPrim().SetInstanceable(True)
        UsdGeom.XformCommonAPI(prim).SetTranslate((2.0 * i, 0, 0))
    gltf = usd_convert(made)
    nodes = named(gltf, "Geo")
    assert [round(gltf.world(n, 1)[0, 3]) for n in nodes] == [0, 2, 4]
    assert [len(gltf.triangles(n)) for n in nodes] == [2, 2, 2]
    assert len({gltf.root["nodes"][n]["mesh"] for n in nodes[1:]}) == 1, "instances of one prototype share their mesh"
    boxed = usd_convert(made, variants=[("", "shape", "box")])
    assert [len(boxed.triangles(n)) for n in named(boxed, "Geo")] == [12] * 3


def test_missing_references_are_named(usd_convert):
    made = u.stage()
    u.camera(made)
    UsdGeom.Xform.Define(made, "/World/Gone").GetPrim().GetReferences().AddReference("gone.usda")
    gltf = usd_convert(made)
    assert any("composition" in i["feature"] and "gone.usda" in i["feature"] for i in gltf.lost.items)


@pytest.mark.parametrize(
    ("kind", "seen"), [("BasisCurves", True), ("BasisCurves", False), ("ParticleField3DGaussianSplat", True), ("GenerativeProcedural", True)]
)
def test_what_cannot_be_drawn_is_named_where_it_would_be_seen(usd_convert, kind, seen):
    made = u.stage()
    u.camera(made)
    prim = UsdGeom.Imageable(made.DefinePrim("/World/Thing", kind))
    if not seen:
        prim.MakeInvisible()
    assert usd_convert(made).lost_features("/World/Thing") == [kind] * seen


def test_types_that_usd_does_not_know_are_named(usd_convert):
    """Where they look like something to draw; settings of other programs do not."""
    made = u.stage()
    u.camera(made)
    made.DefinePrim("/World/Fur", "StudioFur").CreateAttribute("points", Sdf.ValueTypeNames.Point3fArray).Set([(0, 0, 0)])
    made.DefinePrim("/World/Info", "StudioInfo")
    gltf = usd_convert(made)
    assert gltf.lost_features("/World/Fur") == ["StudioFur, a type that USD does not know here"]
    assert not gltf.lost_features("/World/Info")


def test_draw_modes_are_named(usd_convert):
    made = u.stage()
    u.camera(made)
    Usd.ModelAPI(made.GetPrimAtPath("/World")).SetKind("group")
    for name, mode in (("Cards", "cards"), ("Full", "default")):
        prim = UsdGeom.Xform.Define(made, f"/World/{name}").GetPrim()
        Usd.ModelAPI(prim).SetKind("component")
        UsdGeom.ModelAPI.Apply(prim).CreateModelDrawModeAttr(mode)
        u.quad(made, f"/World/{name}/Card")
    gltf = usd_convert(made)
    assert gltf.lost_features("/World/Cards") == ["model:drawMode cards"]
    assert not gltf.lost_features("/World/Full")


@pytest.mark.parametrize(("place", "drawn", "lost"), [("over", 2, []), ("hidden", 2, []), ("class", 0, ["prototype /Protos/Card that is a class"])])
def test_prototypes_elsewhere(usd_convert, place, drawn, lost):
    """Instances are seen though the place of their prototype is not; USD draws no classes."""
    made = u.stage()
    u.camera(made)
    u.quad(made, "/Protos/Card")
    made.GetPrimAtPath("/Protos").SetSpecifier({"over": Sdf.SpecifierOver, "class": Sdf.SpecifierClass}.get(place, Sdf.SpecifierDef))
    if place == "hidden":
        UsdGeom.Scope.Define(made, "/Protos").CreateVisibilityAttr("invisible")
    instancer = UsdGeom.PointInstancer.Define(made, "/World/Many")
    instancer.CreatePrototypesRel().SetTargets(["/Protos/Card"])
    instancer.CreateProtoIndicesAttr([0, 0])
    instancer.CreatePositionsAttr([(0, 0, 0), (3, 0, 0)])
    gltf = usd_convert(made)
    assert len(named(gltf, "Card")) == drawn
    assert gltf.lost_features("/World/Many") == lost


def test_a_dome_in_a_prototype_is_named(usd_convert):
    from pxr import UsdLux

    made = u.stage()
    u.camera(made)
    UsdLux.DomeLight.Define(made, "/World/Many/Proto/Sky")
    u.quad(made, "/World/Many/Proto/Card")
    instancer = UsdGeom.PointInstancer.Define(made, "/World/Many")
    instancer.CreatePrototypesRel().SetTargets(["/World/Many/Proto"])
    instancer.CreateProtoIndicesAttr([0, 0])
    instancer.CreatePositionsAttr([(0, 0, 0), (3, 0, 0)])
    gltf = usd_convert(made)
    assert gltf.lost_features("/World/Many/Proto/Sky") == ["dome light in a prototype"]
    assert len(named(gltf, "Card")) == 2


def test_what_many_instances_lack_is_named_once(usd_convert, tmp_path):
    asset = Usd.Stage.CreateNew(str(tmp_path / "fur.usda"))
    asset.SetDefaultPrim(UsdGeom.Xform.Define(asset, "/Fur").GetPrim())
    UsdGeom.BasisCurves.Define(asset, "/Fur/Hair")
    asset.Save()
    made = u.stage()
    u.camera(made)
    for i in range(5):
        prim = made.DefinePrim(f"/World/I{i}", "Xform")
        prim.GetReferences().AddReference("fur.usda")
        prim.SetInstanceable(True)
    assert [i["object"] for i in usd_convert(made).lost.items if i["feature"] == "BasisCurves"] == ["/World/I0/Hair"]


@pytest.mark.parametrize(("space", "lost"), [("lin_ap1_scene", ["colour space lin_ap1_scene"]), ("lin_rec709_scene", [])])
def test_other_primaries_are_named(usd_convert, space, lost):
    made = u.stage()
    u.camera(made)
    Usd.ColorSpaceAPI.Apply(made.GetPrimAtPath("/World")).CreateColorSpaceNameAttr(space)
    assert usd_convert(made).lost_features("/World") == lost
