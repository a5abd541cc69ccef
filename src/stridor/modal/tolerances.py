"""What counts as rounding: one page for all that finds, follows and counts modes. Shares of what is said."""

# Growth of a mode, of |λ|. Eigenpairs leave every source with Re λ good to some 1e-11 |λ|; a hundred times that is
# never rounding, and growth that doubles in 1e8 periods is nothing that damping left out of a model would let be.
UNSTABLE_RELATIVE = 1e-9
# Growth where nothing dissipates, of |λ|: modes that meet on the axis part as a square root, so that rounding of 1e-16
# in the matrices is 1e-8 in Re λ.
SPLIT_RELATIVE = 1e-7
# |λ| of a motion as a whole, of the highest frequency looked at: what has no stiffness has λ = 0 as a double root. Only
# where there is such a motion (`at_rest`): where all have a stiffness slow modes count as any other.
AT_REST = 1e-5
# Backward error of an eigenpair above which it is none: of matrices whose entries are known to eight digits.
BELIEVED = 1e-8
# Backward error of a pair that Newton's method settled on in the full problem: what it should reach is 1e-15.
CONFIRMED = 1e-10
AFFORDABLE = 60_000  # unknowns up to which the full problem is solved unasked
