#!/usr/bin/env python3
"""Times the Python package beside Open3D, Embree (through embreex), trimesh, libigl and Warp on one core.

    ./run.sh bunny.obj nefertiti.obj.zst dragon.glb

Engines take turns on the same rays and points of 32-bit floats, each with its own array type made beforehand. Times are those
of the processor; the best and the median of the repetitions are told. Slow engines get fewer rays and points. Every
answer is compared with what firsthit says at its exact tier, which is compared with brute force elsewhere (the program
`brute` of the benches). Needs numpy and trimesh; of the others those are measured that are installed.
"""

import argparse
import ctypes
import gc
import importlib.metadata
import json
import os
import platform
import subprocess
import sys
import tempfile
import time

import numpy as np

import engines
import firsthit
import inputs

RAY_QUERIES = ("closest", "any", "count", "all")
POINT_QUERIES = ("closest_point", "signed_distance", "contains")


def seconds(function, *arguments):
    """Of the processor: on one core that is the time it takes, whatever else the machine is doing."""
    started = time.process_time()
    function(*arguments)
    return time.process_time() - started


class Truth:
    """What is right, by the exact tier."""

    def __init__(self, mesh):
        self.size = inputs.size(mesh)
        self.scene = firsthit.Scene(mesh.vertices.astype("f4"), mesh.faces, precision="exact", threads=0)
        self.known = {}

    def of(self, query, queries):
        key = (query, id(queries))
        if key not in self.known:
            self.known[key] = self.ask(query, queries)
        return self.known[key]

    def ask(self, query, queries):
        if query in ("closest", "any"):
            return self.scene.closest_hit(queries).t_hit
        if query in ("count", "all"):
            return self.scene.count_hits(queries, crossings="surfaces")
        return self.scene.signed_distance(queries)

    def wrong(self, query, queries, answer):
        """How many answers to the first of the queries are wrong; None if it cannot be told from this answer."""
        if query == "all":
            # Lists: as many hits of each ray as there are crossings.
            if not (isinstance(answer, tuple) and len(answer[0]) >= 2 and answer[0].ndim == 1 and answer[0][0] == 0):
                return None
            counts = np.diff(answer[0])
            return int((counts != self.of(query, queries)[: len(counts)]).sum())
        if query == "closest_point":
            points = np.asarray(answer[0], "f8")
            distances = np.linalg.norm(points - queries[: len(points)], axis=1)
            return int((np.abs(distances - np.abs(self.of(query, queries)[: len(points)])) > 1e-5 * self.size).sum())
        answer = np.asarray(answer[1] if query == "closest" else answer)
        right = self.of(query, queries)[: len(answer)]
        if query == "closest":
            hit = np.isfinite(right)
            with np.errstate(invalid="ignore"):
                off = np.abs(answer - right) > 1e-4 * right + 1e-5 * self.size
            return int(np.where(hit & np.isfinite(answer), off, hit != np.isfinite(answer)).sum())
        if query == "any":
            return int((answer != np.isfinite(right)).sum())
        if query == "count":
            return int((answer != right).sum())
        # Of points on the surface no side is certain.
        clear = np.abs(right) > 1e-6 * self.size
        if query == "signed_distance":
            return int(((np.sign(answer) != np.sign(right)) & clear).sum())
        return int(((answer != (right < 0)) & clear).sum())

    def leaks(self, rays, t):
        """Rays that go through the surface although eight rays close beside them all hit it. `t`: where they hit."""
        rays = rays[: len(t)].astype("f8")
        origins, directions = rays[:, :3], rays[:, 3:]
        aside = inputs.unit(np.cross(directions, [0.577, 0.211, 0.789]))
        beside = inputs.unit(np.cross(directions, aside))
        last = np.zeros(len(rays))
        for angle in np.arange(8) * np.pi / 4:
            off = (np.cos(angle) * aside + np.sin(angle) * beside) * (2e-6 * self.size)
            last = np.maximum(last, self.scene.closest_hit(origins, directions + off).t_hit)
        # Directions go from the origin to the target.
        return int((np.asarray(t) > last * (1 + 1e-4)).sum())


def race(args, makers, queries, make, truth, say):
    """Every engine in turn, over and over: rows of results by query and kind of input."""
    rows = []
    for kind, of in make.items():
        everything = of["queries"]
        for query in queries:
            runs = []
            for name, engine in makers:
                method = getattr(engine, query)
                if not method:
                    continue
                prepare = engine.points if query in POINT_QUERIES else engine.rays
                # How many it can answer in the time there is.
                few = prepare(everything[:500])
                method(few)
                each = max(seconds(method, few), 1e-6) / 500
                count = int(min(len(everything), max(500, args.seconds / each)))
                runs.append([name, method, prepare(everything[:count]), count, []])
            for name, method, prepared, count, times in runs:
                answer = method(prepared)
                wrong = truth.wrong(query, everything, answer)
                row = {"query": query, "input": kind, "engine": name, "count": count, "wrong": wrong}
                rows.append(row)
                del answer
            for turn in range(args.repeat):
                for k in range(len(runs)):
                    _, method, prepared, _, times = runs[(k + turn) % len(runs)]
                    times.append(seconds(method, prepared))
            for row, (name, _, _, count, times) in zip(rows[-len(runs) :], runs):
                row["best"] = count / min(times) / 1e6
                row["median"] = count / float(np.median(times)) / 1e6
                say(row)
    return rows


def single(args, makers, ray, point):
    """Microseconds of one query a call: the best of many loops."""
    rows = []
    for query, call, of in (("closest", "one_ray", ray), ("any", "one_any", ray), ("closest_point", "one_point", point)):
        calls = [(name, getattr(engine, call)(of)) for name, engine in makers if getattr(engine, call)]
        times = {name: [] for name, _ in calls}
        loops = {name: int(max(20, 0.02 / (seconds(lambda: [run() for _ in range(20)]) / 20 + 1e-7))) for name, run in calls}
        for _ in range(4 * args.repeat):
            for name, run in calls:
                count = loops[name]
                times[name].append(seconds(lambda: [run() for _ in range(count)]) / count * 1e6)
        rows += [
            {"query": query, "engine": name, "best": min(t), "median": float(np.median(t))} for name, t in times.items()
        ]
    return rows


def each_point(args, engine, points):
    """One point a call beside all in one call, for many points: microseconds each, best and median."""
    scene, points = engine.scene, points[:20000].astype("f8")
    times = [[], []]

    def one_by_one():
        for point in points:
            scene.closest_point(point)

    for _ in range(args.repeat):
        times[0].append(seconds(one_by_one) / len(points) * 1e6)
        times[1].append(seconds(lambda: scene.closest_point(points, threads=1).distance) / len(points) * 1e6)
    return {
        name: {"best": min(t), "median": float(np.median(t))} for name, t in zip(("one a call", "all in one call"), times)
    }


def builds(args, mesh):
    """Seconds to build, engines in turn: from arrays to ready for queries."""
    times = {engine.name: [] for engine in engines.ENGINES}
    kinds = [engines.PlainWarp if engine is getattr(engines, "Warp", None) else engine for engine in engines.ENGINES]
    for _ in range(args.repeat):
        for kind in kinds:
            times[kind.name].append(seconds(kind, mesh))
            gc.collect()
    return {name: {"best": min(t), "median": float(np.median(t))} for name, t in times.items()}


def resident():
    """Bytes of memory that the process has, without what was freed and kept for later."""
    gc.collect()
    try:
        ctypes.CDLL(None).malloc_trim(0)
    except AttributeError:
        pass  # another C library
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def memory(arrays, name):
    """Prints how many bytes a process has more after the engine was built, its copy of the mesh included."""
    kinds = [engines.PlainWarp if engine is getattr(engines, "Warp", None) else engine for engine in engines.ENGINES]
    kind = next(engine for engine in kinds if engine.name == name)
    with np.load(arrays) as file:
        mesh = Arrays(file["vertices"], file["faces"])
    # Once with a small mesh: what the libraries themselves need.
    first = kind(Arrays(mesh.vertices, mesh.faces[:100]))
    before = resident()
    built = kind(mesh)
    print(json.dumps({"bytes": resident() - before}))
    del built, first


class Arrays:
    """As much of a mesh as engines are built of."""

    def __init__(self, vertices, faces):
        self.vertices, self.faces = vertices, faces


def bytes_per_triangle(mesh):
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        arrays = os.path.join(folder, "mesh.npz")
        np.savez(arrays, vertices=mesh.vertices.astype("f4"), faces=np.asarray(mesh.faces))
        for kind in engines.ENGINES:
            run = [sys.executable, __file__, "--memory", kind.name, arrays]
            output = subprocess.run(run, capture_output=True, text=True)
            if output.returncode == 0:
                found[kind.name] = json.loads(output.stdout.splitlines()[-1])["bytes"] / len(mesh.faces)
    return found


def table(rows, keys, names, cell):
    """Rows of Markdown: one for each value of the keys, a column for each engine."""
    lines = ["| " + " | ".join(["query", "", *names]) + " |", "|" + "---|" * (2 + len(names))]
    for key in dict.fromkeys(tuple(row.get(k, "") for k in keys) for row in rows):
        found = {row["engine"]: row for row in rows if tuple(row.get(k, "") for k in keys) == key}
        lines.append("| " + " | ".join([*key, *(cell(found[n]) if n in found else "-" for n in names)]) + " |")
    return "\n".join(lines) + "\n"


def versions():
    names = ("numpy", "open3d", "embreex", "trimesh", "libigl", "warp-lang")
    found = {"firsthit": firsthit.__version__}
    for name in names:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            pass
    return found


def measure(args, model, say):
    name, mesh = inputs.load(model)
    count = len(mesh.faces)
    say(f"\n## {name}, {count} triangles\n")
    truth = Truth(mesh)
    result = {"model": name, "triangles": count, "watertight": truth.scene.is_watertight()}

    result["build"] = builds(args, mesh)
    result["bytes_per_triangle"] = bytes_per_triangle(mesh)
    own = engines.Firsthit(mesh).scene.stats
    result["own_bytes_per_triangle"] = own["bytes"] / count
    say("| engine | build, s: best (median) | bytes a triangle |\n|---|---|---|")
    for engine, taken in result["build"].items():
        bytes_each = result["bytes_per_triangle"].get(engine)
        shown = "-" if bytes_each is None else f"{bytes_each:.0f}"
        say(f"| {engine} | {taken['best']:.3f} ({taken['median']:.3f}) | {shown} |")
    say(f"\nfirsthit's own account: {result['own_bytes_per_triangle']:.0f} bytes a triangle.\n")

    makers = [(kind.name, kind(mesh)) for kind in engines.ENGINES]
    names = [engine for engine, _ in makers]
    rays = {kind: {"queries": make(mesh, args.rays)} for kind, make in inputs.RAYS.items()}
    points = {kind: {"queries": make(mesh, args.points)} for kind, make in inputs.POINTS.items()}
    quiet = lambda row: print(row, file=sys.stderr, flush=True) if args.verbose else None
    result["rays"] = race(args, makers, RAY_QUERIES, rays, truth, quiet)
    result["points"] = race(args, makers, POINT_QUERIES, points, truth, quiet)

    def cell(row):
        wrong = "" if row["wrong"] in (0, None) else f", {row['wrong']} wrong"
        fewer = "" if row["count"] >= 100_000 else f" of {row['count']}"
        return f"{row['best']:.3g} ({row['median']:.3g}){wrong}{fewer if wrong else ''}"

    say(table(result["rays"], ("query", "input"), names, cell))
    say(table(result["points"], ("query", "input"), names, cell))

    aimed = inputs.aimed(mesh, 20_000)
    result["leaks"] = {}
    for engine, made in makers:
        if made.closest:
            t = np.asarray(made.closest(made.rays(aimed))[1])
            result["leaks"][engine] = truth.leaks(aimed, np.where(np.isfinite(t), t, np.inf))
    say("Leaks of 20000 rays aimed at corners and edges: " + ", ".join(f"{k} {v}" for k, v in result["leaks"].items()))

    hit = np.flatnonzero(np.isfinite(truth.of("closest", rays["incoherent"]["queries"])))[0]
    ray, point = rays["incoherent"]["queries"][hit].copy(), points["volume"]["queries"][0].copy()
    result["single"] = single(args, makers, ray, point)
    say("\nMicroseconds of one query a call:\n")
    say(table(result["single"], ("query", "input"), names, lambda row: f"{row['best']:.2f} ({row['median']:.2f})"))
    result["each_point"] = each_point(args, makers[0][1], points["volume"]["queries"])
    each = ", ".join(f"{k} {v['best']:.2f} ({v['median']:.2f})" for k, v in result["each_point"].items())
    say(f"firsthit, closest points of 20000 in the volume, microseconds each: {each}")
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="+")
    parser.add_argument("--rays", type=int, default=1_000_000, help="rays of a kind (default: a million)")
    parser.add_argument("--points", type=int, default=200_000, help="points of a kind (default: 200,000)")
    parser.add_argument("--repeat", type=int, default=5, help="repetitions (default: 5)")
    parser.add_argument("--seconds", type=float, default=0.5, help="most that one repetition may take (default: 0.5)")
    parser.add_argument("--json", help="write the numbers to this file")
    parser.add_argument("--note", action="append", default=[], help="a sentence for that file")
    parser.add_argument("--verbose", action="store_true", help="say what is done")
    parser.add_argument("--memory", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.memory:
        return memory(args.models[0], args.memory)

    processor = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if "model name" in line), "")
    machine = f"{processor}, {os.cpu_count()} cores, bound to {sorted(os.sched_getaffinity(0))}; {platform.python_version()}"
    load = [os.getloadavg()]
    record = {"machine": machine, "versions": versions(), "notes": args.note, "models": []}
    print(machine + "; " + ", ".join(f"{name} {version}" for name, version in record["versions"].items()))
    print(f"\nMillions a second: the best (the median) of {args.repeat} repetitions.")
    for model in args.models:
        record["models"].append(measure(args, model, lambda line: print(line, flush=True)))
        load.append(os.getloadavg())
    record["load"] = load
    print("\nLoad of the machine in the last minute, before and after each model: " + ", ".join(f"{x[0]:.1f}" for x in load))
    if args.json:
        with open(args.json, "w") as file:
            json.dump(record, file, indent=1)


if __name__ == "__main__":
    main()
