"""Say where a model and a recording differ, which physics was left out, and how sure that is.

`entry.diagnose` looks at the recordings and sends them one of four ways; all return a `diagnosis.Diagnosis`.

    forces      attitude and noise are known: 18 positions, a static run
    together    several such recordings of one unit
    gimballed   the same with gyroscopes: forces first, then the views of the gyroscopes
    unstated    nobody states the noise: telescopes, units turned by hand, tilting tables

`forces` calls, in this order:

    observations  the baseline fitted; residuals, and their derivatives at each stage of the forward model
    noise         the white part settled, the rest a grid of nodes to integrate over
    candidates    every cause of the catalogue as columns, and the rivals of `shapes`, which are no cause
    search        each alone, in pairs, in threes, by the closed form of `evidence`; `refine` moves lags and epochs
    threshold     how strong "something is missing" looks on clean recordings of this design
    decide        verdict, hypothesis, twins, probabilities
    model         everything fitted jointly; `verify` on held-out data, `locate` where it is off
    recommend     the manoeuvre that would tell twins apart

`together` runs `observations` to `search` on each recording, then `combine` (evidence adds up) in the place of
`search`, and `pool` (one size, and do they agree) in the place of `model`.

`unstated` makes one or two `views` (with `turning`: the turns between rests) and calls on each:

    stepwise      the strongest of `causes` is taken up, all refitted, again; evidence by `free_scale`
    instead       what else could stand in the place of each
    unstated_where, unstated_words   where the baseline fails, and sentences

`baseline` says which effects a model can hold; `wording` has the sentences that all four share.
"""

from gimbalcal.diagnose.diagnosis import Diagnosis
from gimbalcal.diagnose.entry import diagnose

__all__ = ["Diagnosis", "diagnose"]
