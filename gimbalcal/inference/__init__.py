"""Statistics without physics: information and its null directions, coloured noise, filters, harmonics, minimisers."""
