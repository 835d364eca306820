#!/usr/bin/env python3
"""What becomes of a pipeline when things go wrong: runs are killed, files are cut, emptied, deleted and flipped, two runs write the same
output, the disk is full. Prints a table: a row a stage, and what must be 0 in the last four columns.

    python3 scripts/faults.py --reprobe target/release/reprobe                 50 kills a stage
    python3 scripts/faults.py --reprobe target/debug/reprobe --trials 2        some two minutes

wrong      a damaged file was taken for a result: the next stage, or the same one, ended well with other files than an undisturbed run
unhealed   the same command, run again, did not end with the undisturbed run's files
panics     an exit code that is neither 0 nor 2, or a panic's words on stderr, or no message with exit code 2
left over  temporary files or blocks that are still there after the run that healed

Exit code 1 where one of them is not 0. Needs Python's standard library alone; as root, a full disk is a real one (tmpfs), otherwise a limit on
the size of a file.
"""
import argparse
import hashlib
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SCENE = """<scene version="3.0.0">
<sensor type="perspective"><float name="fov" value="70"/>
  <transform name="to_world"><lookat origin="0, 0, 1.5" target="0, -0.5, 0" up="0, 1, 0"/></transform></sensor>
<bsdf type="twosided" id="wall"><bsdf type="diffuse"/></bsdf>
<shape type="cube"><transform name="to_world"><scale value="2"/></transform><ref id="wall"/></shape>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><translate y="-1"/></transform>
  <bsdf type="roughplastic"><float name="alpha" value="0.15"/></bsdf></shape>
<shape type="sphere"><point name="center" x="0" y="-0.6" z="0"/><float name="radius" value="0.35"/><bsdf type="conductor"/></shape>
<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><scale value="0.5"/><translate y="1.9"/></transform>
  <emitter type="area"><rgb name="radiance" value="12, 11, 10"/></emitter></shape>
</scene>"""
PATH = """{"fov": 70, "size": [48, 27], "frames": [{"origin": [0, 0, 1.5], "target": [0, -0.5, 0]},
{"origin": [0.2, 0.1, 1.4], "target": [0, -0.5, 0]}, {"origin": [0.3, 0.1, 1.2], "target": [0, -0.5, 0]}]}"""

# Each stage: its output, and its arguments.
STAGES = {
    "place-probes": ("probes.json", "place-probes scene.xml --path path.json --count 8 -o probes.json"),
    "resmap": ("resmap", "resmap scene.xml --probes probes.json --size 64x32 -o resmap"),
    "qhmap": ("qhmap", "qhmap resmap --size 64x32 -o qhmap"),
    "curvature": ("curvature.exr", "curvature scene.xml -o curvature.exr"),
    "bake-lightmap": ("lightmap.exr", "bake-lightmap scene.xml --texels 4000 --spp 16 --first-spp 4 -o lightmap.exr"),
    "bake-probes": ("probes", "bake-probes scene.xml --probes probes.json --qhmap qhmap --lightmap lightmap.exr --spp 8 -o probes"),
    "bake-lightfield": ("lightfield", "bake-lightfield scene.xml --probes probes.json --size 32 --spp 2 --bounces 2 -o lightfield"),
    "bake-transport": ("transport", "bake-transport scene.xml --probes probes.json --texels 1500 --rays 64 --relight-rays 500 -o transport"),
    "relight": ("lightmaps", "relight scene.xml --probes transport -o lightmaps"),
    "radiance-probes": ("lit", "render-path scene.xml --path path.json --method radiance-probes --probes transport -o lit"),
    "light-field-probes": ("views", "render-path scene.xml --path path.json --method light-field-probes --probes lightfield -o views"),
    "render-path": ("frames", "render-path scene.xml --path path.json --probes probes --lightmap lightmap.exr --curvature curvature.exr -o frames"),
    "path-trace": ("reference", "render-path scene.xml --path path.json --method path-trace --spp 8 -o reference"),
    "compare": ("report", "compare frames reference -o report"),
}
# Which stages read a stage's output.
READERS = {
    "place-probes": ["resmap", "bake-probes", "bake-lightfield", "bake-transport"],
    "resmap": ["qhmap"],
    "qhmap": ["bake-probes"],
    "curvature": ["render-path"],
    "bake-lightmap": ["bake-probes", "render-path"],
    "bake-probes": ["render-path"],
    "bake-lightfield": ["light-field-probes"],
    "light-field-probes": [],
    "bake-transport": ["relight", "radiance-probes"],
    "relight": [],
    "radiance-probes": [],
    "render-path": ["compare"],
    "path-trace": ["compare"],
    "compare": [],
}
# Times and the pages that show them differ from run to run.
VARYING = {"timings.json"}


class Count:
    def __init__(self):
        self.trials = self.wrong = self.unhealed = self.panics = self.left = 0


class Faults:
    def __init__(self, args):
        self.reprobe = str(Path(args.reprobe).resolve())
        self.random = random.Random(args.seed)
        self.trials = args.trials
        self.table = {}
        self.notes = []
        self.base = Path(tempfile.mkdtemp(prefix="faults-"))
        (self.base / "scene.xml").write_text(SCENE)
        (self.base / "path.json").write_text(PATH)
        self.seconds = {}
        for name, (_, command) in STAGES.items():
            start = time.monotonic()
            done = self.run(command, self.base)
            assert done.returncode == 0, f"{command}: {done.stderr}"
            self.seconds[name] = time.monotonic() - start
        self.whole = {name: self.files(self.base, name) for name in STAGES}

    def command(self, arguments):
        return [self.reprobe, *arguments.split(), "--device", "cpu", "--threads", "2"]

    def run(self, arguments, folder, **more):
        return subprocess.run(self.command(arguments), cwd=folder, capture_output=True, text=True, timeout=600, **more)

    def files(self, folder, stage):
        """Contents of a stage's output, by name, hashed; without what varies."""
        output = folder / STAGES[stage][0]
        paths = [output] if output.is_file() else sorted(p for p in output.rglob("*") if p.is_file())
        return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in paths if p.name not in VARYING}

    def copy(self, without=None):
        """A folder of its own with everything that the stages wrote."""
        folder = Path(tempfile.mkdtemp(prefix="faults-"))
        shutil.copytree(self.base, folder, dirs_exist_ok=True)
        if without:
            output = folder / STAGES[without][0]
            shutil.rmtree(output) if output.is_dir() else output.unlink()
        return folder

    def count(self, fault, stage):
        return self.table.setdefault((stage, fault), Count())

    def note(self, text):
        self.notes.append(text)
        print(f"  {text}", file=sys.stderr)

    def judge_end(self, count, done, what):
        """An exit that is neither success nor an error with a message is a panic."""
        bad = done.returncode not in (0, 2) or "panicked" in done.stderr
        if bad or (done.returncode == 2 and "error" not in done.stderr):
            count.panics += 1
            self.note(f"{what}: exit code {done.returncode}: {done.stderr[-300:]}")

    def heal(self, count, stage, folder, what):
        """The command again: it must end well, with the files of an undisturbed run, and leave nothing beside them."""
        done = self.run(STAGES[stage][1], folder)
        self.judge_end(count, done, what)
        if done.returncode != 0 or self.files(folder, stage) != self.whole[stage]:
            count.unhealed += 1
            self.note(f"{what}: not healed: {done.stderr[-300:]}")
        left = [p for p in folder.rglob("*") if p.name.startswith(".reprobe-") or p.name.endswith(".parts")]
        if left:
            count.left += 1
            self.note(f"{what}: left over: {left[0].name}")

    def kills(self, stage):
        count = self.count("kill", stage)
        for _ in range(self.trials):
            folder = self.copy(without=stage)
            child = subprocess.Popen(self.command(STAGES[stage][1]), cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            time.sleep(self.random.random() * self.seconds[stage])
            child.send_signal(signal.SIGKILL)
            child.wait()
            count.trials += 1
            self.after(count, stage, folder, f"{stage}, killed")

    def after(self, count, stage, folder, what):
        """Readers take nothing wrong; the stage heals."""
        for reader in READERS[stage][:1]:
            expected = self.whole[reader]
            output = folder / STAGES[reader][0]
            kept = folder / "kept"
            output.rename(kept)
            done = self.run(STAGES[reader][1], folder)
            self.judge_end(count, done, f"{what}, read by {reader}")
            if done.returncode == 0 and self.files(folder, reader) != expected:
                count.wrong += 1
                self.note(f"{what}: taken for a result by {reader}")
            if output.exists():
                shutil.rmtree(output) if output.is_dir() else output.unlink()
            kept.rename(output)
        self.heal(count, stage, folder, what)
        shutil.rmtree(folder)

    def damages(self, stage, fault):
        count = self.count(fault, stage)
        for _ in range(self.trials):
            folder = self.copy()
            output = folder / STAGES[stage][0]
            paths = [output] if output.is_file() else sorted(p for p in output.rglob("*") if p.is_file() and p.name not in VARYING)
            path = self.random.choice(paths)
            data = bytearray(path.read_bytes())
            if fault == "delete":
                path.unlink()
            elif fault == "empty":
                path.write_bytes(b"")
            elif fault == "cut":
                path.write_bytes(data[: self.random.randrange(len(data))])
            else:
                # Half of the flips fall into the header.
                end = len(data) if self.random.random() < 0.5 else min(len(data), 2000)
                data[self.random.randrange(end)] ^= 1 << self.random.randrange(8)
                path.write_bytes(data)
            count.trials += 1
            self.after(count, stage, folder, f"{stage}, {fault} of {path.relative_to(folder)}")

    def doubled(self, stage):
        count = self.count("doubled", stage)
        for _ in range(max(1, self.trials // 2)):
            folder = self.copy(without=stage)
            run = lambda: subprocess.Popen(self.command(STAGES[stage][1]), cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            first = run()
            time.sleep(self.random.random() * 0.5 * self.seconds[stage])
            second = run()
            for child in (first, second):
                child.stderr_text = child.communicate()[1]
                done = subprocess.CompletedProcess([], child.returncode, "", child.stderr_text)
                self.judge_end(count, done, f"{stage}, doubled")
                if child.returncode != 0:
                    self.note(f"{stage}, doubled: exit code {child.returncode}: {child.stderr_text[-200:]}")
            count.trials += 1
            if self.files(folder, stage) != self.whole[stage]:
                count.wrong += 1
                self.note(f"{stage}, doubled: other files")
            self.heal(count, stage, folder, f"{stage}, doubled")
            shutil.rmtree(folder)

    def full_disk(self, stage):
        count = self.count("full disk", stage)
        size = sum((self.base / name).stat().st_size for name in self.whole[stage])
        for _ in range(max(1, self.trials // 2)):
            folder = self.copy(without=stage)
            limit = int(size * self.random.uniform(0.1, 0.9))
            disk, mounted = folder / "disk", False
            if os.geteuid() == 0:
                disk.mkdir()
                mount = ["mount", "-t", "tmpfs", "-o", f"size={max(limit, 4096)}", "tmpfs", str(disk)]
                mounted = subprocess.run(mount, capture_output=True).returncode == 0
            if mounted:
                output = folder / STAGES[stage][0]
                place = disk / output.name
                command = STAGES[stage][1].rsplit(" ", 1)[0] + f" disk/{output.name}"
                done = self.run(command, folder)
            else:
                largest = max((self.base / name).stat().st_size for name in self.whole[stage])
                def limited():
                    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                    resource.setrlimit(resource.RLIMIT_FSIZE, (largest // 2, largest // 2))
                done = self.run(STAGES[stage][1], folder, preexec_fn=limited)
            count.trials += 1
            self.judge_end(count, done, f"{stage}, full disk")
            if done.returncode == 0:
                # It fitted after all, or it is a wrong result.
                at = disk if mounted else folder
                if self.files(at, stage) != self.whole[stage]:
                    count.wrong += 1
                    self.note(f"{stage}, full disk: ended well without all files")
            if mounted:
                if place.exists():
                    shutil.copytree(place, output, dirs_exist_ok=True) if place.is_dir() else shutil.copy2(place, output)
                left = [p for p in disk.rglob("*") if p.name.startswith(".reprobe-")]
                subprocess.run(["umount", str(disk)], check=True)
                if left:
                    count.left += 1
                    self.note(f"{stage}, full disk: left over: {left[0].name}")
            self.heal(count, stage, folder, f"{stage}, full disk")
            shutil.rmtree(folder)

    def all(self, stages):
        for stage in stages:
            print(f"{stage} ({self.seconds[stage]:.1f} s)", file=sys.stderr)
            self.kills(stage)
            for fault in ("delete", "empty", "cut", "flip"):
                self.damages(stage, fault)
            self.doubled(stage)
            self.full_disk(stage)
        shutil.rmtree(self.base)

    def markdown(self):
        head = ["stage", "kills", "deleted", "emptied", "cut", "flipped", "doubled", "full disk", "wrong", "unhealed", "panics", "left over"]
        lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
        faults = ["kill", "delete", "empty", "cut", "flip", "doubled", "full disk"]
        total = Count()
        for stage in dict.fromkeys(stage for stage, _ in self.table):
            counts = [self.table[stage, fault] for fault in faults]
            sums = [sum(getattr(c, what) for c in counts) for what in ("wrong", "unhealed", "panics", "left")]
            for what, n in zip(("wrong", "unhealed", "panics", "left"), sums):
                setattr(total, what, getattr(total, what) + n)
            lines.append("| " + " | ".join([stage, *(str(c.trials) for c in counts), *map(str, sums)]) + " |")
        return "\n".join(lines), total.wrong + total.unhealed + total.panics + total.left


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--reprobe", default="target/release/reprobe", help="the binary")
    parser.add_argument("--trials", type=int, default=50, help="of each fault a stage [default: 50]")
    parser.add_argument("--stages", default=",".join(STAGES), help="which of them")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    faults = Faults(args)
    faults.all(args.stages.split(","))
    table, bad = faults.markdown()
    print(table)
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
