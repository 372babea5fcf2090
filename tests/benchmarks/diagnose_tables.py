"""The tables of the benchmark of the diagnosis, from its rows."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

Row = dict[str, Any]
Say = Callable[[str], None]
OUTCOMES = ("right", "set of three", "larger", "unexplained", "wrong", "missed")
SURE = 0.90


def interval(hits: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    z = 1.96
    if n == 0:
        return 0.0, 1.0
    p = hits / n
    middle = (p + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    return float(max(middle - half, 0)), float(min(middle + half, 1))


def share(hits: int, n: int) -> str:
    """ "2 of 300, 0.7 % [0.2, 2.4]"."""
    low, high = interval(hits, n)
    return f"{hits:4d} of {n:4d}  {100 * hits / max(n, 1):5.1f} % [{100 * low:.1f}, {100 * high:.1f}]"


def _of(rows: Sequence[Row], arm: str) -> list[Row]:
    return [r for r in rows if r["arm"].startswith(arm)]


def _arms(rows: Sequence[Row], start: str) -> list[str]:
    return list(dict.fromkeys(r["arm"] for r in rows if r["arm"].startswith(start)))


def report(rows: Sequence[Row], say: Say) -> None:
    """Every table for which there are rows."""
    false_alarms(rows, say)
    singles(rows, say)
    families(rows, say)
    pairs(rows, say)
    strange(rows, say)
    hidden(rows, say)
    static(rows, say)
    honesty(rows, say)
    amplitudes(rows, say)


def false_alarms(rows: Sequence[Row], say: Say) -> None:
    """Clean recordings, other timetables, noise that is not what the header says."""
    chosen = [a for start in ("clean", "timetable", "alien") for a in _arms(rows, start)]
    if not chosen:
        return
    say("\nfalse alarms on recordings in which nothing is missing (something is claimed to be missing)")
    for arm in chosen:
        mine = _of(rows, arm)
        raised = [r for r in mine if r["verdict"] != "adequate"]
        named = sum(bool(r["claims"]) for r in raised)
        say(f"  {arm:42}{share(len(raised), len(mine))}; a cause named in {named}")
        at = (0.05, 0.5, 0.95, 0.99, 1.0)
        levels = " ".join(f"{q:.1f}" for q in np.quantile([r["ln_bayes"] for r in mine], at))
        say(f"      ln Bayes factor at 5, 50, 95, 99 and 100 %: {levels}")
        for r in raised:
            say(f"      seed {r['seed']}: {r['verdict']}, {_said(r)} (ln BF {r['ln_bayes']:.1f})")


def _said(r: Row) -> str:
    if not r["claims"]:
        return f"shape: {r['shapes'][0]}" if r["shapes"] else "no shape"
    return "; ".join(f"{c[0]}:{c[1]} {c[3]:.0%}" + (f" or {', '.join(c[2])}" if c[2] else "") for c in r["claims"])


def singles(rows: Sequence[Row], say: Say) -> None:
    """One effect: outcome by strength."""
    mine = [r for r in rows if r["arm"] == "single"]
    if not mine:
        return
    say("\none effect concealed: share of runs [%]")
    say(f"  {'sigma':>6}{'n':>6}" + "".join(f"{o:>14}" for o in OUTCOMES))
    for sigmas in sorted({r["sigmas"] for r in mine}):
        _outcomes([r for r in mine if r["sigmas"] == sigmas], f"{sigmas:6g}", say)
    for r in mine:
        if r["judged"][0] in ("wrong", "larger") and r["sigmas"] >= 12:
            say(f"      {r['judged'][0]}: {r['concealed'][0]}, axis {r['axis']}, {r['sigmas']:g} sigma: {_said(r)}")


def _outcomes(mine: Sequence[Row], label: str, say: Say) -> None:
    judged = [r["judged"][0] for r in mine]
    cells = "".join(f"{100 * judged.count(o) / len(judged):14.1f}" for o in OUTCOMES)
    say(f"  {label}{len(judged):6d}{cells}")


def families(rows: Sequence[Row], say: Say) -> None:
    """One effect: outcome by family, all strengths of 12 and more."""
    mine = [r for r in rows if r["arm"] == "single" and r["sigmas"] >= 12]
    if not mine:
        return
    say("\nthe same by family, 12 sigma and more: share of runs [%]")
    say(f"  {'':18}{'n':>6}" + "".join(f"{o:>14}" for o in OUTCOMES))
    for name in dict.fromkeys(r["concealed"][0] for r in mine):
        _outcomes([r for r in mine if r["concealed"][0] == name], f"{name:18}", say)


def pairs(rows: Sequence[Row], say: Say) -> None:
    """Two effects of equal strength."""
    mine = _of(rows, "pair")
    if mine:
        say("\ntwo effects concealed, each so strong alone: share of runs [%]")
        say(f"  {'sigma':>6}{'n':>6}{'both named':>14}{'one named':>14}{'unexplained':>14}{'neither':>14}"
            f"{'false discoveries of all named':>34}")  # fmt: skip
    for sigmas in sorted({r["sigmas"] for r in mine}):
        part = [r for r in mine if r["sigmas"] == sigmas]
        n = len(part)
        both = sum(all(r["found"]) for r in part)
        one = sum(sum(r["found"]) == 1 for r in part)
        odd = sum(r["verdict"] == "unexplained" for r in part)
        claims = [c for r in part for c in r["claims"]]
        false = share(sum(not c[4] for c in claims), len(claims))
        cells = "".join(f"{100 * v / n:14.1f}" for v in (both, one, odd, n - both - one - odd))
        say(f"  {sigmas:6g}{n:6d}{cells}{false:>34}")


def strange(rows: Sequence[Row], say: Say) -> None:
    """Effects that no catalogue holds."""
    for arm, title in (
        ("strange", "effects that no catalogue holds, known when the unknown was given its shapes"),
        ("strange new", "effects that no catalogue holds, written afterwards"),
    ):
        mine = [r for r in rows if r["arm"] == arm]
        if mine:
            say(f"\n{title}")
            _strange(mine, say)


def _strange(mine: Sequence[Row], say: Say) -> None:
    detected = [r for r in mine if r["verdict"] != "adequate"]
    odd = [r for r in detected if r["verdict"] == "unexplained"]
    bold = [r for r in detected if any(c[3] >= SURE for c in r["claims"])]
    say(f"  detected                              {share(len(detected), len(mine))}")
    say(f"  called unexplained, where detected    {share(len(odd), len(detected))}")
    say(f"  a wrong cause at 90 %, the highest    {share(len(bold), len(detected))}")
    far = [r for r in detected if r["nearest"][0] > 5]
    say(f"  the same, more than 5 sigmas from any {share(sum(r in odd for r in far), len(far))}")
    say(f"  {'':20}{'n':>5}{'detected':>10}{'unexplained':>13}{'named':>7}{'sigmas the nearest cause leaves':>34}")
    for name in dict.fromkeys(r["concealed"][0] for r in mine):
        part = [r for r in mine if r["concealed"][0] == name]
        seen = [r for r in part if r["verdict"] != "adequate"]
        named = [r for r in seen if r["verdict"] != "unexplained"]
        left = [r["nearest"][0] for r in part]
        spread = f"{min(left):.1f} to {max(left):.1f}"
        say(f"  {name:20}{len(part):5d}{len(seen):10d}{len(seen) - len(named):13d}{len(named):7d}{spread:>34}")
        for r in named:
            near = f"{r['nearest'][1]} leaves {r['nearest'][0]:.1f}"
            say(f"      axis {r['axis']}, {r['sigmas']:g} sigma: {_said(r)}; {near}")


def hidden(rows: Sequence[Row], say: Say) -> None:
    """Effects of temperature on recordings without a thermometer."""
    mine = _of(rows, "hidden")
    if not mine:
        return
    odd = [r for r in mine if r["verdict"] == "unexplained"]
    timed = sum(any("time" in s for s in r["shapes"]) for r in odd)
    named = [r for r in mine if r["claims"]]
    say("\neffects of temperature, 25 sigma, on recordings without the thermometer")
    say(f"  unexplained                           {share(len(odd), len(mine))}; a shape in time in {timed} of them")
    say(f"  something named                       {share(len(named), len(mine))}")
    for r in named:
        say(f"      {r['concealed'][0]}, axis {r['axis']}: {_said(r)}")


def static(rows: Sequence[Row], say: Say) -> None:
    """Static runs that share the forward model."""
    mine = _of(rows, "static")
    if not mine:
        return
    say("\nstatic runs of 48 h, simulated with the same forward model (an inverse crime: the device arms are not)")
    clean = [r for r in mine if not r["concealed"]]
    say(f"  false alarms                          {share(sum(r['verdict'] != 'adequate' for r in clean), len(clean))}")
    full = [r for r in mine if r["concealed"]]
    if full:
        say(f"  {'sigma':>6}{'n':>6}" + "".join(f"{o:>14}" for o in OUTCOMES))
    for sigmas in sorted({r["sigmas"] for r in full}):
        _outcomes([r for r in full if r["sigmas"] == sigmas], f"{sigmas:6g}", say)
    for r in full:
        if r["judged"][0] != "right":
            say(f"      {r['concealed'][0]}, {r['sigmas']:g} sigma: {r['judged'][0]}: {_said(r)}")


def honesty(rows: Sequence[Row], say: Say) -> None:
    """Are causes stated at 90 % right in 90 %? Over all arms together."""
    claims = [(r["arm"].split()[0], c[3], c[4]) for r in rows for c in r["claims"]]
    if not claims:
        return
    say("\nhonesty: of the causes (or named sets) stated with this probability, so many are right")
    for low, high in ((0.0, 0.5), (0.5, 0.8), (0.8, 0.9), (0.9, 1.01)):
        part = [(p, ok) for _, p, ok in claims if low <= p < high]
        if part:
            stated = np.mean([p for p, _ in part])
            say(f"  {low:.2f} to {min(high, 1):.2f}, mean {stated:.3f}   {share(sum(ok for _, ok in part), len(part))}")
    sure = [(arm, ok) for arm, p, ok in claims if p >= SURE]
    for arm in dict.fromkeys(a for a, _ in sure):
        part = [ok for a, ok in sure if a == arm]
        say(f"      of these, arm {arm:12} {share(sum(part), len(part))}")


def amplitudes(rows: Sequence[Row], say: Say) -> None:
    """Share of linear parameters within two of their stated sigmas."""
    pulls = [(r["arm"], name, p) for r in rows if r["arm"] in ("single", "static") for name, p in r["pulls"]]
    if not pulls:
        return
    say("\nsizes of causes named by their own id: (estimate less truth) over stated sigma")
    say(f"  {'':28}{'n':>5}{'within 2':>10}{'mean':>8}{'rms':>8}")
    for arm, title in (("single", "device, all"), ("static", "static run, all")):
        _pull_line(title, [p for a, _, p in pulls if a == arm], say)
    for name in dict.fromkeys(n for a, n, _ in pulls if a == "single"):
        _pull_line("  " + name, [p for a, n, p in pulls if n == name and a == "single"], say)


def _pull_line(title: str, values: Sequence[float], say: Say) -> None:
    if values:
        x = np.array(values)
        say(f"  {title:28}{len(x):5d}{100 * np.mean(np.abs(x) < 2):9.1f}%{x.mean():8.2f}{np.sqrt(np.mean(x**2)):8.2f}")
