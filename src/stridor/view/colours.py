"""Colours of figures and pages, which colour-blind readers can tell apart."""

# Okabe and Ito (2008), in the order in which lines take them.
BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY = "#0072B2", "#D55E00", "#009E73", "#AA4499", "#E69F00", "#56B4E9"
INK, GREY, FAINT = "#222222", "#767676", "#D9D9D9"
COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
STATUS_COLOURS = {"stick": "#C7DDF0", "slip": "#F8F3DF", "separation": "#F6CFA8"}
