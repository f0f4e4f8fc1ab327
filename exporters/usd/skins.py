"""Skinned models: UsdSkel deforms them into time samples of the session layer."""

from __future__ import annotations

from collections.abc import Callable

from pxr import Sdf, Usd, UsdSkel

from ..common.report import Lost
from .stage import Said

# Prototypes of PointInstancers are drawn, though they may stand below an over.
_DRAWN = Usd.PrimIsActive & Usd.PrimIsLoaded & ~Usd.PrimIsAbstract


def bake_skins(stage: Usd.Stage, span: list[float], lost: Lost, said: Said, progress: Callable[[str], None]) -> None:
    """Bake every skinned mesh over a span of time codes, instances made prims of their own where they hold one."""
    while held := _instances_with_skins(stage):
        # Baking writes points, which instances of one prototype cannot have of their own. Others may lie in these.
        for path in held:
            stage.GetPrimAtPath(path).SetInstanceable(False)
    # A SkelRoot that is baked is none any more.
    _name_outside(stage, lost)
    roots = [p.GetPath() for p in stage.Traverse(_DRAWN) if p.IsA(UsdSkel.Root)]
    # UsdSkel passes over what is not defined: it is for as long as the baking takes.
    overs = {p for root in roots for p in root.GetPrefixes() if not stage.GetPrimAtPath(p).HasDefiningSpecifier()}
    _specify(stage, overs, Sdf.SpecifierDef)
    if roots:
        progress(f"baking {len(roots)} skinned models")
        # UsdSkel bakes each frame of the stage's own range, and elsewhere only where there are keys: between these, points would go straight.
        stage.SetStartTimeCode(span[0])
        stage.SetEndTimeCode(span[1])
    for root in roots:
        path, missing = str(root), len(lost.items)
        baked = UsdSkel.BakeSkinning(Usd.PrimRange(stage.GetPrimAtPath(root)))
        said.into(lost, path, "skinning", "what it is about may stand in its rest pose; check it with usdchecker")
        if not baked and len(lost.items) == missing:
            lost.add(path, "skinning", "UsdSkel could not bake it; it stands in its rest pose")
    _specify(stage, overs, Sdf.SpecifierOver)


def _name_outside(stage: Usd.Stage, lost: Lost) -> None:
    """Name what UsdSkel passes over."""
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        if not prim.HasAPI(UsdSkel.BindingAPI) or UsdSkel.Root.Find(prim):
            continue
        binding = UsdSkel.BindingAPI(prim)
        if (binding.GetJointIndicesAttr() or binding.GetBlendShapesAttr()) and binding.GetInheritedSkeleton():
            lost.add(str(prim.GetPath()), "skinned mesh outside of a SkelRoot", "it stands in its rest pose; put it and its skeleton below a SkelRoot")


def _specify(stage: Usd.Stage, paths: set[Sdf.Path], specifier: Sdf.Specifier) -> None:
    for path in paths:
        stage.GetPrimAtPath(path).SetSpecifier(specifier)


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
