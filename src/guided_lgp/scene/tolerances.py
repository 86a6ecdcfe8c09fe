"""What passes for standing and for touching: for the scenes that are accepted, and for plans.

A scene is judged more strictly than the plans in it, so that what is accepted can stay as it is.
"""

OVERLAP = 0.001
"""How deep (m) bodies of a scene may be in each other."""
MARGIN = 0.005
"""How deep (m) bodies may be in each other in a plan: hulls are wider than the meshes in them."""
FLOAT = 0.002
"""How far (m) the bottom of a box may be off its support's top in a scene ..."""
HEIGHT = 0.003
"""... and in a plan, where it is computed anew."""
LEVEL_ANGLE = 0.02
"""Tilt (rad) up to which a box at rest is level."""
GRASP_OFFSET = 0.003
"""How far (m) a grasped box may be off the middle between the fingers in a plan ..."""
GRASP_ANGLE = 0.03
"""... and its side (rad) off their closing direction; a given grasp may be half as far off."""
BALANCE_INSET = 0.005
"""How far (m) inside the support's top a centre of mass lies at least, where a plan puts it; at
least as far, too, as it goes to the side where all leans by ``LEVEL_ANGLE``. In a scene, and as
long as a stack stands as it did there, it has to be above the top and no more."""
