#!/bin/sh
# Makes the pictures of docs/tutorial.md again, by the commands that stand in it: scripts/figure_tutorial.sh [WORK [REPROBE]]
# Needs Python with Pillow (pip install pillow).
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
work=${1:-$(mktemp -d)}
reprobe=$(realpath "${2:-$root/target/release/reprobe}")
mkdir -p "$work"
cp "$root"/scenes/room/* "$work"
cd "$work"
awk '/^```sh$/ { shown = 1; next } /^```/ { shown = 0 } shown && /^reprobe / { sub(/^reprobe /, ""); print }' "$root/docs/tutorial.md" |
    while read -r words; do
        echo "reprobe $words"
        # None of them has words in quotes.
        # shellcheck disable=SC2086
        "$reprobe" $words </dev/null
    done
cp report/images/0000_flip.png flip.png
python3 - "$root/docs/pictures/tutorial" <<'PYTHON'
import os
import sys

from PIL import Image

for name in ["plan", "resmap", "qhmap", "lightmap", "probe", "frame", "why", "both", "flip", "maps"]:
    picture = Image.open(f"{name}.png").convert("RGB")
    picture.thumbnail((960, 640), Image.LANCZOS)
    path = os.path.join(sys.argv[1], f"{name}.jpg")
    for quality in range(85, 40, -5):
        picture.save(path, quality=quality, optimize=True)
        if os.path.getsize(path) < 60_000:
            break
PYTHON
ls -l "$root/docs/pictures/tutorial"
