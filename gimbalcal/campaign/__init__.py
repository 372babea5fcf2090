"""Monte Carlo: the same scenario many times, on all cores or on a cluster, with the same answer whatever the number.

    summary = run_campaign("wang2019-accelerometers-3arcmin", 500, Path("out"))

Every run has its own random stream from the scenario's seed and its number; runs are computed in shares of fixed size,
so neither the number of workers nor an interruption changes a digit. Shares are kept as they come; a campaign that was
stopped goes on where it was. In the end there is one campaign.parquet (one row per run and parameter) and
campaign.json (mean, RMS and ratio to the predicted sigma per parameter).
"""

from gimbalcal.campaign.monte_carlo import run_campaign

__all__ = ["run_campaign"]
