"""Drivers of vibrating vests."""
