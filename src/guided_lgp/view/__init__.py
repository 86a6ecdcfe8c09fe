"""Pictures of a scene, replays of a plan as a page, and the live viewer."""
