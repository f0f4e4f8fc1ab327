"""Skinned models: UsdSkel deforms them into time samples of the session layer."""

from __future__ import annotations

from collections.abc import Callable

from pxr import Sdf, Usd, UsdSkel

from ..common.report import Lost


def bake_skins(stage: Usd.Stage, lost: Lost, progress: Callable[[str], None]) -> None:
    """Bake every skinned mesh, instances made prims of their own where they hold one."""
    while held := _instances_with_skins(stage):
        # Baking writes points, which instances of one prototype cannot have of their own. Others may lie in these.
        for path in held:
            stage.GetPrimAtPath(path).SetInstanceable(False)
    roots = [p for p in stage.Traverse() if p.IsA(UsdSkel.Root)]
    if roots:
        progress(f"baking {len(roots)} skinned models")
    for root in roots:
        if not UsdSkel.BakeSkinning(Usd.PrimRange(root)):
            lost.add(str(root.GetPath()), "skinning", "UsdSkel could not bake it; it stands in its rest pose")


def _instances_with_skins(stage: Usd.Stage) -> set[Sdf.Path]:
    """The outermost instances that hold a skinned mesh."""
    prims = list(stage.Traverse(Usd.TraverseInstanceProxies()))
    cache = UsdSkel.Cache()
    for prim in prims:
        if prim.IsA(UsdSkel.Root):
            cache.Populate(UsdSkel.Root(prim), Usd.TraverseInstanceProxies())
    proxies = ((p, cache.GetSkinningQuery(p)) for p in prims if p.IsInstanceProxy())
    return {_outermost_instance(p) for p, skin in proxies if skin and (skin.HasJointInfluences() or skin.HasBlendShapes())}


def _outermost_instance(prim: Usd.Prim) -> Sdf.Path:
    while prim.IsInstanceProxy():
        prim = prim.GetParent()
    return prim.GetPath()
