"""Skinned models, by themselves and in instances."""

from __future__ import annotations

import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")
import usd_scene as u
from pxr import Gf, Usd, UsdGeom, UsdSkel


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
    assert moves(usd_convert(made)) == [True]


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
