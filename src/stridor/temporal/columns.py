"""Columns of what every stepper records and accumulates: one meaning for all of them."""

# Statistics kept per contact at every step.
STICK_STEPS, SLIP_STEPS, OPEN_STEPS, MAX_NORMAL, MAX_SPEED, MAX_TANGENTIAL, FIRST_STICK, FIRST_OPEN = range(8)
STATISTICS = 8
# Works accumulated at every step [J].
DAMPING, FRICTION, NORMAL, EXTERNAL, SUPPORT = range(5)
WORKS = 5
# A contact record.
REC_NORMAL, REC_TANGENTIAL, REC_SLIP, REC_GAP, REC_STATUS, REC_POSITION = range(6)
CONTACT_RECORD = 6
# Energies of a record [J]: kinetic and elastic at t_{n−1/2}, then the works up to there.
ENERGY_RECORD = 7
WORK_COLUMNS = {
    "damping": DAMPING,
    "friction": FRICTION,
    "contact": NORMAL,
    "external": EXTERNAL,
    "support": SUPPORT,
}
