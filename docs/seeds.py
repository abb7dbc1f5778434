#!/usr/bin/env python3
"""Runs a scenario with several seeds and prints sigma, rms error over sigma, and largest error over sigma of each component.

    cargo build --release
    python3 docs/seeds.py scenarios/pan-wu-3d.toml --runs 50
"""
import argparse
import json
import math
import subprocess


def run(command, scenario, seed, settings):
    sets = [word for s in [f"seed={seed}", *settings] for word in ("--set", s)]
    arguments = [command, "run", scenario, "--format", "json", "--no-output", *sets]
    return json.loads(subprocess.run(arguments, check=True, capture_output=True, text=True).stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenario")
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--set", action="append", default=[], metavar="KEY.PATH=VALUE")
    parser.add_argument("--navfuse", default="target/release/navfuse")
    a = parser.parse_args()
    results = [run(a.navfuse, a.scenario, seed, a.set) for seed in range(1, a.runs + 1)]
    print("| state | unit | sigma | rms(error/sigma) | largest |\n|---|---|---|---|---|")
    for name, state in results[0]["states"].items():
        for k, sigma in enumerate(state["sigma"]):
            if sigma <= 0 or state["error"] is None:
                continue
            own = [r["states"][name] for r in results]
            mean = sum(s["sigma"][k] for s in own) / a.runs
            ratios = [s["error"][k] / s["sigma"][k] for s in own]
            rms = math.sqrt(sum(x * x for x in ratios) / a.runs)
            print(f"| `{name}` {k + 1} | {state['unit']} | {mean:.3g} | {rms:.2f} | {max(map(abs, ratios)):.1f} |")
    for name, sensor in results[0]["samples"].items():
        if sensor.get("mean_nis") is not None:
            nis = [r["samples"][name]["mean_nis"] for r in results]
            print(f"\nMean NIS of `{name}` over {a.runs} runs: {sum(nis) / a.runs:.3f}"
                  f" (from {min(nis):.2f} to {max(nis):.2f}).")
    errors = [r["horizontal_error_m"]["final"] for r in results if r["horizontal_error_m"]]
    if errors:
        rms = math.sqrt(sum(e * e for e in errors) / len(errors))
        print(f"Horizontal error at the end: {rms:.2f} m rms after {results[0]['distance_m']:.0f} m.")


if __name__ == "__main__":
    main()
