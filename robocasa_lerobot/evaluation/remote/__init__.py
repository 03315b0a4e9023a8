"""Policies that are asked over a socket: three protocols, key maps for what each server expects, and a first probe."""
