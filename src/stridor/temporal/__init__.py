"""Temporal approach: explicit β2 scheme with forward-increment Lagrange multipliers (paper 1.4)."""
