"""The PandaOmron: a Franka arm on a mobile base with a torso."""
