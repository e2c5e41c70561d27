"""Drivers for TEGA: a template. Importing it must stay quick, so the drivers are in modules of their own."""
