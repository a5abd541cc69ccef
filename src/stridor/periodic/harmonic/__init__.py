"""Limit cycles by harmonic balance, condensed to the contact nodes."""
