"""The tables of the benchmark without a stated noise, from its rows."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from tests.benchmarks.diagnose_tables import OUTCOMES, SURE, Row, Say, share

EDGES = (0.0, 0.3, 0.5, 0.7, 0.9, 1.01)
PLANTS = {
    "hand": "units turned by hand, chambers",
    "mount": "mounts of telescopes and antennas",
    "table": "tilting tables",
}


def report(rows: Sequence[Row], say: Say) -> None:
    """Every table for which there are rows."""
    clean(rows, say)
    concealed(rows, say)
    strange(rows, say)
    confounded(rows, say)
    honesty(rows, say)
    sizes(rows, say)
    say(
        f"\ntime of one diagnosis: median {np.median([r['seconds'] for r in rows]):.1f} s, most "
        f"{max(r['seconds'] for r in rows):.1f} s"
    )


def said(r: Row) -> str:
    """Everything that a diagnosis claims."""
    named = [
        f"{c[0]}:{c[1]} {c[3]:.0%}{' (true)' if c[4] else ''}" + (f" or {', '.join(c[2])}" if c[2] else "")
        for c in r["claims"]
    ]
    return "; ".join(named + [f"shape: {s}" for s in r["shapes"]]) or "nothing"


def _told(r: Row) -> str:
    o = r["options"]
    kind = ", ".join(f"{k} {v:.3g}" if isinstance(v, float) else f"{k} {v}" for k, v in o.items() if v)
    return (
        f"      {r['plant']} {'+'.join(r['concealed'])} axis {r['axis']}, {r['sigmas']:g} sigma, seed {r['seed']}"
        + (f" ({kind}{', held' if r['held'] else ''})" if o else "")
    )


def clean(rows: Sequence[Row], say: Say) -> None:
    """False alarms: anything claimed that is not there, or a shape."""
    say("\nfalse alarms on recordings in which nothing is missing but what every mount has")
    for plant, words in PLANTS.items():
        mine = [r for r in rows if r["arm"] == "clean" and r["plant"] == plant]
        raised = [r for r in mine if r["shapes"] or any(not c[4] for c in r["claims"])]
        if mine:
            say(f"  {words:42}{share(len(raised), len(mine))}")
        for r in raised:
            say(f"{_told(r)}: {said(r)}")


def concealed(rows: Sequence[Row], say: Say) -> None:
    """One effect, and two: outcome by plant and strength."""
    for arm, title in (("one", "one effect concealed"), ("pair", "two effects concealed, each so strong alone")):
        mine = [r for r in rows if r["arm"] == arm]
        if not mine:
            continue
        say(f"\n{title}: share of effects [%]")
        say(f"  {'':42}{'sigma':>6}{'n':>6}" + "".join(f"{o:>14}" for o in OUTCOMES))
        for plant, words in PLANTS.items():
            for sigmas in sorted({r["sigmas"] for r in mine}):
                judged = [j for r in mine if (r["plant"], r["sigmas"]) == (plant, sigmas) for j in r["judged"]]
                if judged:
                    cells = "".join(f"{100 * judged.count(o) / len(judged):14.1f}" for o in OUTCOMES)
                    say(f"  {words:42}{sigmas:6g}{len(judged):6d}{cells}")
        for r in mine:
            if set(r["judged"]) - {"right", "set of three"}:
                say(f"{_told(r)}: {', '.join(r['judged'])}: {r['verdict']}: {said(r)}")


def strange(rows: Sequence[Row], say: Say) -> None:
    """Laws that no catalogue holds."""
    mine = [r for r in rows if r["arm"] == "strange"]
    if not mine:
        return
    shape = [r for r in mine if r["shapes"] and all(c[4] for c in r["claims"])]
    bold = [r for r in mine if any(c[3] >= SURE and not c[4] for c in r["claims"])]
    missed = [r for r in mine if not r["shapes"] and all(c[4] for c in r["claims"])]
    say("\nlaws that no catalogue holds")
    say(f"  a shape, and nothing false named      {share(len(shape), len(mine))}")
    say(f"  a wrong cause at 90 %, the highest    {share(len(bold), len(mine))}")
    say(f"  missed                                {share(len(missed), len(mine))}")
    for r in mine:
        if r not in shape:
            say(f"{_told(r)}: {said(r)}")


def confounded(rows: Sequence[Row], say: Say) -> None:
    """Causes that the recording cannot tell apart."""
    mine = [r for r in rows if r["arm"] == "confounded"]
    if mine:
        good = [r for r in mine if r["judged"][0] not in ("wrong", "missed") and r["beside"][0]]
        say(f"\nnot identifiable: the truth stands with what is confounded with it {share(len(good), len(mine))}")
    for r in mine:
        if r not in good:
            say(f"{_told(r)}: {r['verdict']}: {said(r)}")


def honesty(rows: Sequence[Row], say: Say) -> None:
    """Are causes stated at 90 % right in 90 %; is "adequate" true."""
    claims = [(c[3], c[4]) for r in rows for c in r["claims"]]
    say("\nhonesty, all arms together: of the causes (or named sets) stated with this probability, so many are right")
    for low, high in pairwise(EDGES):
        part = [ok for p, ok in claims if low <= p < high]
        mean = np.mean([p for p, _ in claims if low <= p < high]) if part else np.nan
        say(f"  {low:4.0%} to {min(high, 1):4.0%}  mean {mean:4.0%}  {share(sum(part), len(part))}")
    full = [r for r in rows if r["concealed"] and r["sigmas"] >= 12]
    false = [r for r in full if r["verdict"] == "adequate"]
    say(f'  false "adequate" at 12 sigma and more  {share(len(false), len(full))}')
    lost = [r for r in full if "missed" in r["judged"] and not r["shapes"] and r["verdict"] != "adequate"]
    say(f"  an effect neither named nor told of   {share(len(lost), len(full))}")
    for r in false:
        say(f"{_told(r)}")


def sizes(rows: Sequence[Row], say: Say) -> None:
    """Errors of sizes in stated sigmas."""
    pulls = np.array([p for r in rows for _, p in r["pulls"]])
    if len(pulls):
        say(
            f"\nsizes within two stated sigmas           {share(int(np.sum(np.abs(pulls) < 2)), len(pulls))}; "
            f"rms of error over sigma {np.sqrt(np.mean(pulls**2)):.2f}, median {np.median(np.abs(pulls)):.2f}"
        )
