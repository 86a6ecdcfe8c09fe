"""Write the lock files from the packages of this environment, with the hashes of the index.

PyTorch has a file of its own, without a hash: which of its builds an index has differs from machine
to machine.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
TORCH = "torch=="


def main() -> None:
    """Freeze, ask pip which file it would install for each package, and write both files."""
    pip = [sys.executable, "-m", "pip"]
    frozen = subprocess.run(
        [*pip, "freeze", "--all", "--exclude-editable"], check=True, capture_output=True, text=True
    ).stdout.split()
    pinned = [line.partition("+")[0] for line in frozen if "==" in line]
    names = [name for name in pinned if not name.startswith("pip==")]
    with tempfile.TemporaryDirectory() as folder:
        wanted, report = Path(folder) / "wanted.txt", Path(folder) / "report.json"
        wanted.write_text("\n".join(n for n in names if not n.startswith(TORCH)))
        options = ["--dry-run", "--ignore-installed", "--no-deps", "--report", str(report)]
        subprocess.run([*pip, "install", "-q", *options, "-r", str(wanted)], check=True)
        chosen = json.loads(report.read_text(encoding="utf-8"))["install"]
    lines = [
        f"{entry['metadata']['name']}=={entry['metadata']['version']}"
        f" --hash=sha256:{entry['download_info']['archive_info']['hashes']['sha256']}\n"
        for entry in sorted(chosen, key=lambda entry: entry["metadata"]["name"].lower())
    ]
    (ROOT / "requirements.lock").write_text("".join(lines))
    torch = [f"{name}\n" for name in names if name.startswith(TORCH)]
    (ROOT / "requirements-torch.lock").write_text("".join(torch))


if __name__ == "__main__":
    main()
