"""Plan one task from Python: stack two boxes and pick up the third."""

from pathlib import Path

from guided_lgp import load_scene, plan

scene = load_scene(Path(__file__).parent / "three_boxes.json")
result = plan(scene, ["(on red green)", "(held blue)"])
if result.path is None:
    print("no plan:", result.explanation)
else:
    for action in result.path.skeleton:
        print(action)
