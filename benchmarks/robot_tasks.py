"""Tasks carried out by each robot with the model ``rules``: routes, rooms, storeys, people.

    python benchmarks/robot_tasks.py [--seeds 5] [--only route,town,rooms,storeys,people]

``route`` is to the refrigerator by each robot on the ground, ``town`` directives from the air,
``rooms`` a flight indoors, ``storeys`` over the stairs, ``people`` past somebody who walks about.

Prints one JSON object a line: a row for each episode, then one for each group.  ``rules`` reads
the simulator's labels: these figures show that the robots work, and say nothing about multimodal
models.
"""

from __future__ import annotations

import argparse
import json
import statistics
from collections.abc import Iterator

from chosen import names_among

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.scenario_loading import robot_setting

GROUND = ("cobot_magic", "unitree_go1", "unitree_g1")
STOREYS = ("bathtub", "yellow_bed", "sofa", "refrigerator")
Episode = tuple[str, str, str, int]
"""Scenario, robot (empty: the scenario's), task and seed."""


def groups(seeds: int) -> dict[str, list[Episode]]:
    """Returns the episodes of each group."""
    return {
        "route": [("apartment", r, "fridge", seed) for r in GROUND for seed in range(seeds)],
        "town": [("town", "", task, 0) for task in load_scenario("town").tasks],
        "rooms": [("flat", "quadrotor", "couch", seed) for seed in range(2)],
        "storeys": [("two_storey", "", task, 0) for task in STOREYS],
        "people": [("apartment_people", "", "fridge", seed) for seed in range(seeds)],
    }


def rows(episodes: list[Episode]) -> Iterator[dict[str, object]]:
    """Runs episodes, and returns what each came to."""
    for scenario, robot, task, seed in episodes:
        overlay = f"{{random_seed: {seed}, task: {{text: '@{task}'}}"
        overlay += f", robot: {robot_setting(robot)}}}" if robot else "}"
        result = run_episode(load_scenario(scenario, overlay))
        metrics = result.metrics
        yield {
            "scenario": scenario,
            "robot": result.robot,
            "task": task,
            "seed": seed,
            "success": result.success,
            "cause": result.cause,
            "navigation_error_m": metrics.navigation_error_m,
            "spl": metrics.spl,
            "path_length_m": metrics.path_length_m,
            "collisions": metrics.collisions,
            "person_contacts": metrics.person_contacts,
            "simulated_s": result.time.simulated_s,
        }


def main() -> None:
    """Prints the rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5)
    known = tuple(groups(0))
    parser.add_argument(
        "--only",
        type=names_among("group", known),
        default=[],
        help=f"groups, of {','.join(known)}; default: all",
    )
    arguments = parser.parse_args()
    for name, episodes in groups(arguments.seeds).items():
        if arguments.only and name not in arguments.only:
            continue
        found = []
        for row in rows(episodes):
            print(json.dumps({"id": f"{name}.episode", **row}), flush=True)
            found.append(row)
        share = statistics.mean(bool(row["success"]) for row in found)
        target = {"route": 1.0, "town": 0.8}.get(name)
        ok = None if target is None else share >= target
        line = {"id": name, "what": "share of successes", "value": share, "target": target}
        print(
            json.dumps({**line, "sense": target and ">=", "unit": "1", "ok": ok, "n": len(found)})
        )


if __name__ == "__main__":
    main()
