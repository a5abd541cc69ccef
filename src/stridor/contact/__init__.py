"""Where two bodies touch: surfaces, pairing, the relative-motion operators and the multipliers."""
