"""Opening a USD stage, its variants chosen, and what is missing from it named."""

from __future__ import annotations

import re
from pathlib import Path

from pxr import Tf, Usd, UsdUtils

from ..common.report import InputError, Lost


def reason(error: object) -> str:
    """What an error of USD's says is wrong: its text ends with that, in quotes."""
    return " ".join(str(error).split()).rsplit(" : ", 1)[-1].strip("' ")


class Said:
    """What USD warns of, which would otherwise stand on the terminal for nobody in particular."""

    def __init__(self) -> None:
        self._delegate = UsdUtils.CoalescingDiagnosticDelegate()

    def into(self, lost: Lost, name: str, feature: str, action: str) -> None:
        """Name what was said since the last time; `name` is the object where the words have none."""
        for said in self._delegate.TakeUncoalescedDiagnostics():
            # What cannot be composed is named when the stage is opened, and said again at every change.
            if "WARNING" in said.diagnosticCodeString and not said.sourceFunction.endswith("_ReportErrors"):
                # Layers in memory are called by an address, another one at every run.
                text = re.sub("anon:0x[0-9a-f]+:", "", " ".join(said.commentary.split()))
                where = re.search(r"<(/[^<>.]+)|^(/[^ .]+)", text)
                object_ = (where[1] or where[2]) if where else name
                lost.add(object_, f"{feature}: {text.removeprefix(f'{object_} -- ')[:200]}", action)


def open_stage(source: Path, variants: list[tuple[str, str, str]], lost: Lost) -> Usd.Stage:
    """Open a stage with variants chosen in its session layer, which is never saved."""
    if not Path(source).is_file():
        raise InputError(f"{source}: no such file")
    # What is missing is taken from GetCompositionErrors(); USD's own stack traces on the terminal help nobody.
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        stage = Usd.Stage.Open(str(source))
    except Tf.ErrorException as error:
        # The first is the parser's own, which names the line.
        raise InputError(f"{source}: not a USD stage ({reason(error.args[0])})") from None
    finally:
        delegate.TakeUncoalescedDiagnostics()
        del delegate
    stage.SetEditTarget(stage.GetSessionLayer())
    # Its times are those of the stage; a layer that says nothing has 24 codes a second, and what is baked into it would play at another speed.
    stage.SetTimeCodesPerSecond(stage.GetTimeCodesPerSecond())
    for path, name, choice in variants:
        prim = stage.GetPrimAtPath(path) if path else stage.GetDefaultPrim()
        owners = [prim] if prim and name in prim.GetVariantSets().GetNames() else []
        if not path:
            owners = owners or [p for p in stage.Traverse() if name in p.GetVariantSets().GetNames()]
        if not owners:
            have = sorted({f"{p.GetPath()}:{n}" for p in stage.Traverse() for n in p.GetVariantSets().GetNames()})
            raise InputError(
                f"variant set {name!r}: {path or 'no prim of the stage'} {'has it not' if path else 'has it'}; there are {', '.join(have) or 'none'}"
            )
        for owner in owners:
            have = owner.GetVariantSet(name).GetVariantNames()
            if choice not in have:
                raise InputError(f"variant {name}={choice}: {owner.GetPath()} has {', '.join(have)}")
            owner.GetVariantSet(name).SetVariantSelection(choice)
    for error in stage.GetCompositionErrors():
        text = " ".join(str(error).split())
        where = re.search(r"<([^<>]*)>", str(getattr(error, "rootSite", ""))) or re.search(r"<([^<>]*)>", text)
        name = where[1] if where else str(source)
        lost.add(name, f"composition: {text[:200]}", "what it refers to is missing from the picture; check the path")
    return stage
