"""Modal approach: complex modes of the friction-coupled system, their onsets and branches."""
