"""Checks that anybody's driver can be put through; they need no test framework."""
