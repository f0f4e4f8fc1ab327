"""Skinned models, by themselves and in instances."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")
import usd_scene as u
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel


def skeleton(made, path):
    """A skeleton of one joint that moves along Z: 0 at frame 1, 2 at frame 3."""
    prim = UsdSkel.Skeleton.Define(made, path)
    prim.CreateJointsAttr(["Joint"])
    prim.CreateBindTransformsAttr([Gf.Matrix4d(1)])
    prim.CreateRestTransformsAttr([Gf.Matrix4d(1)])
    animation = UsdSkel.Animation.Define(made, f"{path}/Anim")
    animation.CreateJointsAttr(["Joint"])
    animation.CreateRotationsAttr([Gf.Quatf(1)])
    animation.CreateScalesAttr([Gf.Vec3h(1)])
    for frame in (1, 3):
        animation.CreateTranslationsAttr().Set([Gf.Vec3f(0, 0, frame - 1)], frame)
    UsdSkel.BindingAPI.Apply(prim.GetPrim()).CreateAnimationSourceRel().SetTargets([f"{path}/Anim"])


def card(made, path):
    """A card that the joint moves."""
    binding = UsdSkel.BindingAPI.Apply(u.quad(made, path).GetPrim())
    binding.CreateJointIndicesPrimvar(False, 1).Set([0] * 4)
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * 4)
    return binding


def model(made, path):
    """A skinned model below an Xform."""
    UsdGeom.Xform.Define(made, path)
    UsdSkel.Root.Define(made, f"{path}/Model")
    skeleton(made, f"{path}/Model/Skel")
    card(made, f"{path}/Model/Card").CreateSkeletonRel().SetTargets([f"{path}/Model/Skel"])


def asset(folder, name, build):
    """A file whose default prim /Asset was filled by `build`; its path."""
    made = Usd.Stage.CreateNew(str(folder / name))
    build(made)
    made.SetDefaultPrim(made.GetPrimAtPath("/Asset"))
    made.Save()
    return str(folder / name)


def instance(made, path, name):
    """An instanceable reference to a file."""
    prim = made.DefinePrim(path, "Xform")
    prim.GetReferences().AddReference(name)
    prim.SetInstanceable(True)
    return prim


def moves(gltf):
    """For each drawn node whether its card is 2 along Z at frame 3."""
    nodes = [i for i, n in enumerate(gltf.root["nodes"]) if "mesh" in n]
    return [gltf.animated((n, "weights")) and gltf.posed_points(n, 3)[:, 2] == pytest.approx([2] * 4) for n in nodes]


def test_skinned_meshes_are_baked(usd_convert):
    made = u.stage(frames=(1, 3))
    u.camera(made)
    model(made, "/World/Actor")
    gltf = usd_convert(made)
    assert moves(gltf) == [True]
    assert not gltf.lost_features("/World/Actor/Model/Card")


def test_models_in_instances(usd_convert, tmp_path):
    """Below an instance, and in an instance inside another one."""
    actor = asset(tmp_path, "actor.usda", lambda made: model(made, "/Asset"))
    group = asset(tmp_path, "group.usda", lambda made: instance(made, "/Asset/Actor", actor))
    made = u.stage(frames=(1, 3))
    u.camera(made)
    instance(made, "/World/One", actor)
    instance(made, "/World/Two", group)
    assert moves(usd_convert(made)) == [True, True]


def test_instances_in_a_model(usd_convert, tmp_path):
    """What a skeleton outside of the instance moves is a mesh of its own; what none moves stays an instance."""
    body = asset(tmp_path, "body.usda", lambda made: card(made, "/Asset/Card"))
    hat = asset(tmp_path, "hat.usda", lambda made: u.quad(made, "/Asset/Hat"))
    made = u.stage(frames=(1, 3))
    u.camera(made)
    UsdSkel.Root.Define(made, "/World/Model")
    skeleton(made, "/World/Model/Skel")
    UsdSkel.BindingAPI.Apply(instance(made, "/World/Model/Body", body)).CreateSkeletonRel().SetTargets(["/World/Model/Skel"])
    for i in range(2):
        instance(made, f"/World/Model/Hat{i}", hat)
    gltf = usd_convert(made)
    assert moves(gltf) == [True, False, False]
    assert len({n["mesh"] for n in gltf.root["nodes"] if n.get("name") == "Hat"}) == 1


@pytest.mark.parametrize("specifier", [Sdf.SpecifierDef, Sdf.SpecifierOver])
def test_crowds(usd_convert, specifier):
    """Models that a PointInstancer scatters, below a prim that is drawn itself or not."""
    made = u.stage(frames=(1, 3))
    u.camera(made)
    model(made, "/Actors/One")
    made.GetPrimAtPath("/Actors").SetSpecifier(specifier)
    crowd = UsdGeom.PointInstancer.Define(made, "/World/Crowd")
    crowd.CreatePrototypesRel().SetTargets(["/Actors/One"])
    crowd.CreateProtoIndicesAttr([0, 0])
    crowd.CreatePositionsAttr([(0, 0, 0), (5, 0, 0)])
    assert moves(usd_convert(made)) == [True] * (2 if specifier == Sdf.SpecifierOver else 3)


@pytest.mark.parametrize(
    ("codes", "rate", "span", "frames"), [(24, 24, True, None), (60, 60, True, None), (1000, 24, True, None), (30, 30, False, None), (24, 24, True, (3, 20))]
)
def test_joints_turn_between_their_keys(usd_convert, codes, rate, span, frames):
    """Two keys a second apart: a quarter turn, at the stage's speed, with the range in the stage, in its keys, or asked for."""
    made = u.stage(frames=(0, codes if frames is None else 1) if span else None, rate=codes)
    made.SetFramesPerSecond(rate)
    u.camera(made)
    model(made, "/World/Actor")
    animation = UsdSkel.Animation(made.GetPrimAtPath("/World/Actor/Model/Skel/Anim"))
    animation.GetTranslationsAttr().Clear()
    animation.CreateTranslationsAttr([Gf.Vec3f(0)])
    for code, angle in ((0, 0), (codes, 90)):
        animation.CreateRotationsAttr().Set([Gf.Quatf(Gf.Rotation(Gf.Vec3d(0, 0, 1), angle).GetQuat())], code)
    gltf = usd_convert(made, frames=frames)
    for frame in (3, rate // 2, 20):
        angle = np.pi / 2 * frame / rate
        want = (np.sin(angle) - np.cos(angle), -np.sin(angle) - np.cos(angle), 0)
        np.testing.assert_allclose(gltf.posed_points(gltf.node("Card"), frame)[0], want, atol=1e-4)


def test_skins_that_cannot_be_baked_are_named(usd_convert, capfd):
    """By what UsdSkel says of them, which stands nowhere else."""
    made = u.stage(frames=(1, 3))
    u.camera(made)
    model(made, "/World/Actor")
    UsdSkel.BindingAPI(made.GetPrimAtPath("/World/Actor/Model/Card")).GetJointWeightsPrimvar().Set([1.0] * 3)
    gltf = usd_convert(made)
    assert gltf.lost_features("/World/Actor/Model") == ["skinning: Size of jointIndices [4] != size of jointWeights [3]."]
    assert "jointWeights" not in capfd.readouterr().err


def test_skeletons_that_do_not_exist_are_named(usd_convert):
    made = u.stage(frames=(1, 3))
    u.camera(made)
    model(made, "/World/Actor")
    UsdSkel.BindingAPI(made.GetPrimAtPath("/World/Actor/Model/Card")).GetSkeletonRel().SetTargets(["/World/Gone"])
    assert any("/World/Gone" in f for f in usd_convert(made).lost_features("/World/Actor/Model/Card"))


def test_skinned_meshes_outside_of_a_root_are_named(usd_convert):
    made = u.stage(frames=(1, 3))
    u.camera(made)
    model(made, "/World/Actor")
    made.GetPrimAtPath("/World/Actor/Model").SetTypeName("Xform")
    u.quad(made, "/World/Actor/Model/Card/Prop")
    gltf = usd_convert(made)
    assert not any(moves(gltf))
    assert gltf.lost_features("/World/Actor/Model/Card") == ["skinned mesh outside of a SkelRoot"]
    assert not gltf.lost_features("/World/Actor/Model/Card/Prop")
