"""What is explained: a recording as residuals about its baseline, and their derivatives."""
