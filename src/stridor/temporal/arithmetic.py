"""What the compiled loops may do to the order of additions."""

# Reassociation lets dot products run in vector registers; NaN and infinity stay honoured, because a
# run that blows up must be seen.
FAST = {"reassoc", "contract", "nsz", "arcp"}
# At the contacts the order of additions stays as written; divisions by constants may become products.
CAREFUL = {"contract", "nsz", "arcp"}
